!> What error estimates and nodal stresses keep between load cases and rounds: patches and factors that depend on meshes
!> and materials alone, and the recovered strains of the last displacements.
module dotyk_control_kept_estimates
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_memory, only: allowance_t, memory_now, memory_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_element_residual, only: bubble_factor_t
  use dotyk_elasticity_gradient_recovery, only: gradient_recovery_t
  use dotyk_ranks_communication, only: n_local_ranks
  implicit none
  private

  type, public :: kept_class_t  !! Of one class of congruent bodies.
    !> Recovered strains in each material, those of the last displacements (n_materials).
    type(gradient_recovery_t), allocatable :: recovery(:)
    type(bubble_factor_t), allocatable :: factor(:)  !! Factors of the element residuals (n_elements).
    type(allowance_t) :: room  !! Memory for these factors.
  contains
    procedure :: init => class_init
  end type kept_class_t

  type, public :: kept_estimates_t  !! Of all bodies.
    type(kept_class_t), allocatable :: of_class(:)  !! At the place of the representative (n_bodies).
  contains
    procedure :: init => kept_init
    procedure :: allow => kept_allow
  end type kept_estimates_t

  !> Patches take one of so many parts of the memory, at most; factors of element residuals the rest.
  integer, parameter :: part_of_patches = 4
  !> Fraction of the memory that is left which estimates, or load cases together, take at most [].
  real(dp), parameter, public :: most_of_memory = 0.25_dp

contains

  !> Nothing is kept yet, and nothing may be; unless that was done before.
  subroutine kept_init(self, n)
    class(kept_estimates_t), intent(inout) :: self
    integer, intent(in) :: n  !! Number of bodies.
    if (.not. allocated(self%of_class)) allocate (self%of_class(n))
  end subroutine kept_init

  !> Make the places of what is kept, unless that was done before.
  subroutine class_init(self, body)
    class(kept_class_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The representative.
    if (allocated(self%recovery)) return
    allocate (self%recovery(size(body%material)), self%factor(body%mesh%n_elements()))
  end subroutine class_init

  !> Allow to keep data between load cases, unless that was done before: a quarter of the memory that is left at most.
  subroutine kept_allow(self, body, represents, bytes)
    class(kept_estimates_t), intent(inout) :: self
    type(body_t), intent(in) :: body(:)  !! The bodies (n_bodies).
    logical, intent(in) :: represents(:)  !! Whether a body represents a class of which this rank has bodies (n_bodies).
    integer(int64), intent(in) :: bytes(:)  !! Memory that data of each may take (n_bodies) [bytes].
    type(memory_t) :: memory
    real(dp) :: allowed
    integer :: b
    if (allocated(self%of_class)) return
    call self%init(size(body))
    memory = memory_now()
    if (.not. memory%is_known) return
    allowed = sum(real(bytes, dp), mask=represents)
    if (.not. allowed > 0) return
    allowed = min(1.0_dp, most_of_memory*memory%left/n_local_ranks()/allowed)
    do b = 1, size(body)
      if (.not. represents(b)) cycle
      call self%of_class(b)%init(body(b))
      associate (patches => self%of_class(b)%recovery, room => int(allowed*real(bytes(b), dp), int64))
        patches%room%left = room/(part_of_patches*size(patches))
        self%of_class(b)%room%left = room - room/part_of_patches
      end associate
    end do
  end subroutine kept_allow
end module dotyk_control_kept_estimates
