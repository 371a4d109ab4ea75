!> What a body answers to contact forces: forces at its contact nodes in, displacements of the same nodes out.
!>
!> Everything is in Cartesian components; rotated unknowns and eliminated supports stay inside. A response is the action of
!> `K^{-1}` with supports at rest, so the answer to no force is no displacement. Where the supports leave rigid motions R free, it
!> is that of the Moore-Penrose inverse `K^+`: the resultants of the forces are taken off (`P f`, `P = I - R R^T`), and of the
!> displacements in equilibrium with the rest it gives the one without rigid motion.
module dotyk_response_response
  use dotyk_base_kinds, only: dp
  implicit none
  private

  !> One body's response, in one of its forms.
  type, abstract, public :: response_t
    !> Space dimension.
    integer :: dimension = 0
    !> Number of nodes where contact forces may act.
    integer :: n_contact_nodes = 0
    !> Number of free rigid motions; 0 for a body that is held.
    integer :: n_motions = 0
    !> They at the contact nodes, orthonormal over the whole body (dimension*n_contact_nodes, n_motions) [1].
    real(dp), allocatable :: motion(:, :)
    !> Diagonal of the stiffness at the contact nodes, for preconditioners; 0 along prescribed unknowns, and everywhere where it is not
    !> known (dimension*n_contact_nodes) [force/length].
    real(dp), allocatable :: diagonal(:)
  contains
    !> Contact forces to displacements of the contact nodes.
    procedure(apply_interface), deferred :: apply
    !> The same for many forces at a time. Many threads may do this with one response.
    procedure(apply_block_interface), deferred :: apply_block
    !> A full solve in the body's equations, for loads and for the recovery of interior displacements.
    procedure(solve_interface), deferred :: solve
    !> Give back all memory.
    procedure(destroy_interface), deferred :: destroy
  end type response_t

  !> One place in an array of responses that may have different forms.
  type, public :: response_slot_t
    !> The response; not allocated where a body has none.
    class(response_t), allocatable :: form
  end type response_slot_t

  abstract interface
    !> u = S K^+ S^T f with S the restriction to the contact nodes.
    subroutine apply_interface(self, force, displacement)
      import :: response_t, dp
      class(response_t), intent(inout) :: self
      !> Forces (dimension, n_contact_nodes) [force].
      real(dp), intent(in) :: force(:, :)
      !> Displacements (dimension, n_contact_nodes) [length].
      real(dp), intent(out) :: displacement(:, :)
    end subroutine apply_interface

    !> Several u = S K^+ S^T f.
    subroutine apply_block_interface(self, force, displacement)
      import :: response_t, dp
      class(response_t), intent(in) :: self
      !> Forces, one case a column (dimension*n_contact_nodes, m) [force].
      real(dp), intent(in) :: force(:, :)
      !> Displacements (dimension*n_contact_nodes, m) [length].
      real(dp), intent(out) :: displacement(:, :)
    end subroutine apply_block_interface

    !> x := K^+ x.
    subroutine solve_interface(self, x)
      import :: response_t, dp
      class(response_t), intent(inout) :: self
      !> Right-hand side [force] in, solution [length] out (n_equations), in the body's equations.
      real(dp), intent(inout) :: x(:)
    end subroutine solve_interface

    !> Give back all memory.
    subroutine destroy_interface(self)
      import :: response_t
      class(response_t), intent(inout) :: self
    end subroutine destroy_interface
  end interface
end module dotyk_response_response
