!> What a body answers to contact forces: forces at its contact nodes in, displacements of the same nodes out.
!>
!> Everything is in Cartesian components; rotated unknowns and eliminated supports stay inside. A response is the action of
!> `K^{-1}` with supports at rest, so the answer to no force is no displacement. Where the supports leave rigid motions R free, it
!> is that of the Moore-Penrose inverse `K^+`: the resultants of the forces are taken off (`P f`, `P = I - R R^T`), and of the
!> displacements in equilibrium with the rest it gives the one without rigid motion.
module dotyk_response_response
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_forward_substitution, only: forward_solution_t
  use dotyk_linalg_sparse, only: sparse_rows_t
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
    !> Springs that resist the motions; none where not allocated (n_motions, n_motions) [force/length].
    real(dp), allocatable :: motion_stiffness(:, :)
    !> Diagonal of the stiffness at the contact nodes, for preconditioners; 0 along prescribed unknowns, and everywhere where it is not
    !> known (dimension*n_contact_nodes) [force/length].
    real(dp), allocatable :: diagonal(:)
  contains
    !> Contact forces to displacements of the contact nodes.
    procedure(apply_interface), deferred :: apply
    !> Get ready for forward substitutions; to be called by one thread.
    procedure(prepare_interface), deferred :: prepare_forward_substitution
    !> Entries of the factor that a forward substitution for one contact node goes through, in the mean; needs no factor yet.
    procedure(path_entries_interface), deferred :: path_entries
    !> Forward substitutions for rows of B; many threads may do this with one response.
    procedure(forward_substitution_interface), deferred :: forward_substitution
    !> B K^+ B^T for the rows of two lots of forward substitutions; many threads may.
    procedure(forward_product_interface), deferred :: forward_product
    !> A full solve in the body's equations, for loads and for the recovery of interior displacements.
    procedure(solve_interface), deferred :: solve
    !> Give back all memory.
    procedure(destroy_interface), deferred :: destroy
  end type response_t

  !> Forward substitutions for some rows b of B.
  type, public :: forward_response_t
    !> L^{-1} b, L the factor of the stiffness (of the held one where motions are free).
    type(forward_solution_t) :: forward
    !> b R and b Z, free motions and what the held body answers to them, at the rows (n, n_motions).
    real(dp), allocatable :: along(:, :), answer(:, :)
  end type forward_response_t

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

    !> Get ready.
    subroutine prepare_interface(self)
      import :: response_t
      class(response_t), intent(inout) :: self
    end subroutine prepare_interface

    !> Entries of a path.
    real(dp) function path_entries_interface(self)
      import :: response_t, dp
      class(response_t), intent(inout) :: self
    end function path_entries_interface

    !> Forward substitutions.
    subroutine forward_substitution_interface(self, matrix, row, forward)
      import :: response_t, sparse_rows_t, forward_response_t
      class(response_t), intent(in) :: self
      !> Rows of B over the contact nodes' components: column (i-1)*dimension + component of contact node i.
      type(sparse_rows_t), intent(in) :: matrix
      !> Which of them.
      integer, intent(in) :: row(:)
      type(forward_response_t), intent(inout) :: forward
    end subroutine forward_substitution_interface

    !> c_ij = b_i K^+ b_j.
    subroutine forward_product_interface(self, a, b, same, c)
      import :: response_t, forward_response_t, dp
      class(response_t), intent(in) :: self
      type(forward_response_t), intent(in) :: a, b
      !> Whether a and b are one and the same.
      logical, intent(in) :: same
      !> (a%forward%n, b%forward%n) [length/force].
      real(dp), intent(out) :: c(:, :)
    end subroutine forward_product_interface

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
