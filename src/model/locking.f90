!> The decision whether linear elements are elevated to order 2 against volumetric locking.
module dotyk_model_locking
  use dotyk_base_error, only: error_t
  use dotyk_base_options, only: analysis_plane_stress, locking_auto
  use dotyk_elasticity_material, only: material_t
  use dotyk_input_case, only: case_t
  use dotyk_model_materials, only: build_material, linear_simplices_lock
  implicit none
  private
  public :: would_lock

contains

  !> Whether linear triangles, tetrahedra, prisms and pyramids would lock in a body: they are elevated to order 2.
  logical function would_lock(case, b) result(locks)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: b  !! Index of the body.
    type(material_t) :: material
    type(error_t), allocatable :: failed
    integer :: k
    locks = .false.
    if (case%solver%locking /= locking_auto .or. case%scene%analysis == analysis_plane_stress) return
    do k = 1, size(case%body(b)%material)
      ! Errors are reported where the body is built.
      call build_material(case%material(case%body(b)%material(k)), case%solver%locking, material, failed)
      if (.not. allocated(failed)) locks = locks .or. material%incompressibility >= linear_simplices_lock
    end do
  end function would_lock
end module dotyk_model_locking
