!> Some of the bodies of a scene, from some volumes of its mesh files: what one rank builds of a scene of many bodies.
module dotyk_model_chosen_bodies
  use dotyk_base_error, only: error_t, problem_list_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t
  use dotyk_mesh_conversion, only: meshing_t
  use dotyk_mesh_joints, only: joints_t
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_mesh_selection, only: mesh_selection_t
  use dotyk_model_body_setup, only: build_body
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_model_mesh_file, only: add_unions, meshing_of, read_mesh
  use dotyk_model_mesh_survey, only: mesh_survey_t
  use dotyk_model_volumes, only: volume_t
  use dotyk_ranks_exchange, only: meet
  implicit none
  private

  type, public :: chosen_bodies_t  !! The bodies of a scene, some of them built.
    type(body_t), allocatable :: body(:)  !! Bodies, not yet assembled; those that were not chosen are empty (n_bodies).
    type(body_surfaces_t), allocatable :: surfaces(:)  !! Their surfaces that contact pairs may need (n_bodies).
    !> How the parts of their volumes hang together, those of the first body of each volume (n_bodies).
    type(joints_t), allocatable :: joints(:)
    !> Whether each support and each load is that of a named body, or acts on one of the bodies that were built
    !> (n_supports), (n_loads).
    logical, allocatable :: support_used(:), load_used(:)
    type(problem_list_t) :: problems  !! What is wrong with them.
  contains
    procedure :: init => chosen_bodies_init
    procedure :: has => chosen_bodies_has
    procedure :: build => chosen_bodies_build
  end type chosen_bodies_t

contains

  !> Without any body so far.
  subroutine chosen_bodies_init(self, case)
    class(chosen_bodies_t), intent(out) :: self
    type(case_t), intent(in) :: case  !! The case.
    allocate (self%body(size(case%body)), self%surfaces(size(case%body)), self%joints(size(case%body)))
    self%support_used = .not. case%support%any_body
    self%load_used = .not. case%load%any_body
  end subroutine chosen_bodies_init

  !> Whether a body was built.
  pure logical function chosen_bodies_has(self, b) result(has)
    class(chosen_bodies_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    has = allocated(self%body(b)%mesh%x)
  end function chosen_bodies_has

  !> Build bodies. All ranks call it together; each may choose others, or none.
  subroutine chosen_bodies_build(self, case, survey, chosen)
    class(chosen_bodies_t), intent(inout) :: self
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_survey_t), intent(in) :: survey  !! What the mesh files have.
    logical, intent(in) :: chosen(:)  !! Which bodies (n_bodies).
    type(mesh_selection_t) :: selection
    type(meshing_t) :: meshing
    type(mesh_t) :: mesh
    type(error_t), allocatable :: failed
    logical :: of_file(size(chosen))
    integer :: b
    meshing = meshing_of(case)
    selection%everything = .false.
    selection%dimension = case%scene%dimension
    do b = 1, size(chosen)
      if (interrupted()) exit
      if (survey%first_of_file(b) /= b) cycle
      of_file = chosen .and. survey%first_of_file == b
      if (.not. any(of_file)) then
        ! The others meet where they read the file.
        call meet()
        cycle
      end if
      selection%volume = survey%volumes(case, of_file)
      call read_mesh(case%body(b)%mesh, case%scene%dimension, mesh, meshing, failed, selection)
      if (.not. allocated(failed)) then
        call add_unions(case, case%body(b)%mesh, mesh)
        call build_bodies_of(self, case, survey, mesh, of_file)
      end if
      call self%problems%add_error(failed)
    end do
  end subroutine chosen_bodies_build

  !> Build bodies of one file.
  subroutine build_bodies_of(self, case, survey, mesh, chosen)
    class(chosen_bodies_t), intent(inout) :: self
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_survey_t), intent(in) :: survey  !! What the mesh files have.
    type(mesh_t), intent(in) :: mesh  !! Their volumes.
    logical, intent(in) :: chosen(:)  !! Which bodies (n_bodies).
    type(volume_t) :: volume
    logical :: of_volume(size(chosen))
    integer :: c, k
    do c = 1, size(chosen)
      of_volume = chosen .and. survey%first_of_volume == c
      if (.not. any(of_volume)) cycle
      call volume%take(mesh, case%scene, case%body(c), survey%locks(c))
      self%joints(c) = volume%joints
      do k = c, size(chosen)
        if (of_volume(k)) call build_body(case, mesh, volume, k, self%body(k), self%surfaces(k), self%support_used, &
                                          self%load_used, self%problems)
      end do
    end do
  end subroutine build_bodies_of
end module dotyk_model_chosen_bodies
