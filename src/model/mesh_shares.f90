!> Shares of the mesh files: what each rank reads where all ranks compute large bodies together.
module dotyk_model_mesh_shares
  use dotyk_base_error, only: error_t, problem_list_t
  use dotyk_base_kinds, only: int64
  use dotyk_base_options, only: analysis_3d, response_auto, response_multigrid
  use dotyk_base_text, only: to_text
  use dotyk_input_case, only: case_t
  use dotyk_mesh_conversion, only: meshing_t
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_mesh_selection, only: mesh_selection_t
  use dotyk_model_mesh_file, only: add_unions, meshing_of, read_mesh
  use dotyk_model_mesh_survey, only: mesh_survey_t
  use dotyk_model_volume_parts, only: volume_share_t
  use dotyk_model_volumes, only: volume_t
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: agree_on_error
  implicit none
  private

  type, public :: mesh_shares_t  !! The shares of this rank.
    !> Shares of the files, those of bodies that are the first ones of a file (n_bodies).
    type(mesh_t), allocatable :: mesh(:)
    !> The first body of the same file, and of the same volume (n_bodies).
    integer, allocatable :: first_of_file(:), first_of_volume(:)
    type(volume_share_t), allocatable, private :: volume(:)  !! Shares of the volumes, those of first bodies (n_bodies).
    !> Number of bodies that use each of these volumes; 0 for other bodies (n_bodies).
    integer, allocatable, private :: n_uses(:)
    !> Weights of the bodies of the volumes before each one; that of all bodies behind them (n_bodies + 1).
    integer(int64), allocatable, private :: before(:)
  contains
    procedure :: read => shares_read
    procedure :: take_part => shares_take_part
  end type mesh_shares_t

contains

  !> Read this rank's shares, where a body may be large enough.
  subroutine shares_read(self, case, survey, fewest_unknowns, suits, error)
    class(mesh_shares_t), intent(out) :: self
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_survey_t), intent(in) :: survey  !! What the files have of the bodies.
    integer, intent(in) :: fewest_unknowns  !! Unknowns that the largest body has at least, where bodies are split.
    !> Whether the shares are of use: not for plane analyses, for elements that would be elevated, and for small bodies.
    logical, intent(out) :: suits
    !> The same on all ranks: all files that cannot be read, have no such volume, or inverted elements, one per line.
    type(error_t), allocatable, intent(out) :: error
    type(problem_list_t) :: problems
    type(error_t), allocatable :: failed
    type(mesh_selection_t) :: selection
    type(meshing_t) :: meshing
    integer :: b, c, n
    n = size(case%body)
    suits = case%scene%analysis == analysis_3d .and. any(case%solver%response == [response_auto, response_multigrid])
    if (suits) suits = survey%is_known .and. .not. any(survey%locks)
    if (suits .and. case%solver%response == response_auto) &
      suits = any([(case%scene%dimension*survey%most_nodes(b) >= fewest_unknowns, b=1, n)])
    if (.not. suits) return
    allocate (self%mesh(n), self%volume(n))
    self%first_of_file = survey%first_of_file
    self%first_of_volume = survey%first_of_volume
    meshing = meshing_of(case)
    selection%everything = .false.
    selection%n_shares = n_ranks()
    selection%share = this_rank()
    do b = 1, n
      if (self%first_of_file(b) /= b) cycle
      selection%volume = survey%volumes(case, self%first_of_file == b)
      call read_mesh(case%body(b)%mesh, case%scene%dimension, self%mesh(b), meshing, failed, selection)
      call agree_on_error(failed)
      if (allocated(failed)) then
        call problems%add_error(failed)
        cycle
      end if
      call add_unions(case, case%body(b)%mesh, self%mesh(b))
      do c = b, n
        if (self%first_of_file(c) /= b .or. self%first_of_volume(c) /= c) cycle
        call self%volume(c)%take(self%mesh(b), case%body(c)%volume, case%scene%dimension, failed)
        call problems%add_error(failed, case%file//':'//to_text(case%body(c)%line)//': ')
      end do
    end do
    call problems%raise(error)
    if (allocated(error)) return
    allocate (self%n_uses(n), source=0)
    do c = 1, n
      self%n_uses(self%first_of_volume(c)) = self%n_uses(self%first_of_volume(c)) + 1
    end do
    allocate (self%before(n + 1), source=0_int64)
    do c = 1, n
      self%before(c + 1) = self%before(c)
      if (self%n_uses(c) > 0) self%before(c + 1) = self%before(c) + self%n_uses(c)*self%volume(c)%weight()
    end do
  end subroutine shares_read

  !> The part of this rank of a volume: all volumes are on one curve, in equal lengths for each rank.
  subroutine shares_take_part(self, case, b, volume)
    class(mesh_shares_t), intent(inout) :: self
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: b  !! First body of the volume.
    type(volume_t), intent(out) :: volume  !! The part.
    call volume%take_part(self%mesh(self%first_of_file(b)), case%body(b)%volume, self%volume(b), &
                          self%n_uses(b), self%before(b), self%before(size(self%before)))
  end subroutine shares_take_part
end module dotyk_model_mesh_shares
