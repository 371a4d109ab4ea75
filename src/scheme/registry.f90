!> The schemes by the names of the input.
module dotyk_scheme_registry
  use dotyk_base_options, only: scheme_neumann, scheme_robin
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_neumann, only: neumann_t
  use dotyk_scheme_robin, only: robin_t
  use dotyk_scheme_scheme, only: scheme_t
  implicit none
  private
  public :: make_scheme

contains

  !> The scheme with a name; for 'auto' the best one, which is the dual scheme.
  subroutine make_scheme(name, scheme)
    integer, intent(in) :: name  !! One of `scheme_*` of dotyk_base_options.
    class(scheme_t), allocatable, intent(out) :: scheme  !! The scheme of that name.
    select case (name)
    case (scheme_neumann)
      allocate (neumann_t :: scheme)
    case (scheme_robin)
      allocate (robin_t :: scheme)
    case default
      allocate (dual_t :: scheme)
    end select
  end subroutine make_scheme
end module dotyk_scheme_registry
