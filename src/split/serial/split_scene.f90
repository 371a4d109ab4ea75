!> Bodies that all ranks compute together: none in a program without MPI.
module dotyk_split_split_scene
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_response_response, only: response_slot_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use dotyk_scheme_scheme, only: scheme_t
  implicit none
  private
  public :: can_split

  type, public :: split_scene_t  !! The bodies of a scene.
  contains
    procedure, nopass :: assemble
    procedure, nopass :: factorize
    procedure, nopass :: take_responses
    procedure, nopass :: take_scheme
    procedure, nopass :: destroy
  end type split_scene_t

contains

  !> Whether there are several ranks, and what splits bodies.
  pure logical function can_split()
    can_split = .false.
  end function can_split

  !> Nothing.
  subroutine assemble(body, modes, error)
    type(body_t), intent(inout) :: body(:)  !! Bodies (n_bodies).
    type(body_modes_t), intent(in) :: modes(:)  !! Their rigid body modes (n_bodies).
    type(error_t), allocatable, intent(out) :: error  !! Not allocated.
    associate (not_needed => size(body), nor_this => size(modes))
    end associate
  end subroutine assemble

  !> Nothing.
  subroutine factorize(body, operator, report, error)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_operator_t), intent(in) :: operator  !! Contact rows.
    type(factorization_report_t), allocatable, intent(out) :: report(:)  !! Empty (n_bodies).
    type(error_t), allocatable, intent(out) :: error  !! Not allocated.
    allocate (report(size(body)))
    associate (not_needed => operator%n_rows)
    end associate
  end subroutine factorize

  !> Nothing.
  subroutine take_responses(body, modes, response)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(body_modes_t), intent(in) :: modes(:)  !! Their rigid body modes (n_bodies).
    type(response_slot_t), intent(inout) :: response(:)  !! Unchanged (n_bodies).
    associate (not_needed => [size(body), size(modes), size(response)])
    end associate
  end subroutine take_responses

  !> Nothing.
  subroutine take_scheme(most_iterations, scheme)
    integer, intent(in) :: most_iterations  !! Not used.
    class(scheme_t), allocatable, intent(inout) :: scheme  !! Unchanged.
    associate (not_needed => allocated(scheme), nor_this => most_iterations)
    end associate
  end subroutine take_scheme

  !> Nothing.
  subroutine destroy()
  end subroutine destroy
end module dotyk_split_split_scene
