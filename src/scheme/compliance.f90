!> The compliance operator C = B K^+ B^T of all bodies at the rows of a contact QP, as the schemes see it.
!>
!> B lives in the QP (`dotyk_scheme_contact_qp`), K^+ here; a restriction of a QP to some of its rows, or an aggregation
!> of them, is passed to the same operator. Products are always possible. Entries are where they were formed: what forms
!> them, and what it costs, is up to the extension (`dotyk_scheme_dense_compliance`, `dotyk_scheme_body_compliance`).
module dotyk_scheme_compliance
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private

  !> Entries of C between some rows of one body.
  type, public :: entries_t
    !> (n, n), symmetric [length/force].
    real(dp), allocatable :: value(:, :)
  end type entries_t

  !> The operator.
  type, abstract, public :: compliance_t
    !> Solves of every body so far: products without entries, and what forming entries costs in such solves.
    integer :: n_sweeps = 0
  contains
    !> z = C lambda.
    procedure(multiply_interface), deferred :: multiply
    !> Form the entries at all rows of a QP.
    procedure(form_interface), deferred :: form
    !> Whether all entries at the rows of a QP are there.
    procedure(is_formed_interface), deferred :: is_formed
    !> Whether entries at any rows are there.
    procedure(has_entries_interface), deferred :: has_entries
    !> Entries between some rows of one body.
    procedure(get_entries_interface), deferred :: get_entries
    !> Diagonal entries at some rows.
    procedure(get_diagonal_interface), deferred :: get_diagonal
    !> An approximate diagonal that needs no entries.
    procedure(nodal_diagonal_interface), deferred :: nodal_diagonal
    !> What a row of entries, and a product without entries, cost.
    procedure(get_costs_interface), deferred :: get_costs
    !> Rows of which the entries are there, of the QP that all others are restrictions of.
    procedure(mark_formed_interface), deferred :: mark_formed
    !> All entries at the rows of a QP that need not be a restriction, body by body.
    procedure(form_all_interface), deferred :: form_all
    !> Energy norm of a difference of two states.
    procedure :: distance => compliance_distance
  end type compliance_t

  abstract interface
    !> z = C lambda.
    subroutine multiply_interface(self, qp, lambda, z)
      import :: compliance_t, contact_qp_t, dp
      !> The compliance of the bodies.
      class(compliance_t), intent(inout) :: self
      !> The rows.
      type(contact_qp_t), intent(in) :: qp
      !> Contact forces, weights included (n_rows) [force].
      real(dp), intent(in) :: lambda(:)
      !> Normal displacements of the rows (n_rows) [length].
      real(dp), intent(out) :: z(:)
    end subroutine multiply_interface

    !> Form entries.
    subroutine form_interface(self, qp, may_stop)
      import :: compliance_t, contact_qp_t
      !> The compliance of the bodies.
      class(compliance_t), intent(inout) :: self
      !> The rows.
      type(contact_qp_t), intent(in) :: qp
      !> Whether an interrupt ends it, with entries that are not valid; not if absent.
      logical, intent(in), optional :: may_stop
    end subroutine form_interface

    !> Whether all entries are there.
    pure logical function is_formed_interface(self, qp)
      import :: compliance_t, contact_qp_t
      !> The compliance of the bodies.
      class(compliance_t), intent(in) :: self
      !> The rows.
      type(contact_qp_t), intent(in) :: qp
    end function is_formed_interface

    !> Whether any entries are there.
    pure logical function has_entries_interface(self)
      import :: compliance_t
      !> The compliance of the bodies.
      class(compliance_t), intent(in) :: self
    end function has_entries_interface

    !> Entries of one body's part of C.
    subroutine get_entries_interface(self, qp, b, row, entries)
      import :: compliance_t, contact_qp_t, dp
      !> The compliance of the bodies.
      class(compliance_t), intent(in) :: self
      !> Formed.
      type(contact_qp_t), intent(in) :: qp
      !> The body.
      integer, intent(in) :: b
      !> Rows of the QP that touch the body (n).
      integer, intent(in) :: row(:)
      !> Entries (n, n) [length/force].
      real(dp), allocatable, intent(out) :: entries(:, :)
    end subroutine get_entries_interface

    !> Diagonal of C.
    subroutine get_diagonal_interface(self, qp, row, diagonal)
      import :: compliance_t, contact_qp_t, dp
      !> The compliance of the bodies.
      class(compliance_t), intent(in) :: self
      !> Formed at the rows.
      type(contact_qp_t), intent(in) :: qp
      !> Some of its rows (n).
      integer, intent(in) :: row(:)
      !> Diagonal entries (n) [length/force].
      real(dp), intent(out) :: diagonal(:)
    end subroutine get_diagonal_interface

    !> `B D^{-1} B^T`, D the diagonal of the stiffness: each row with its nodes alone.
    subroutine nodal_diagonal_interface(self, qp, diagonal)
      import :: compliance_t, contact_qp_t, dp
      !> The compliance of the bodies.
      class(compliance_t), intent(in) :: self
      !> The rows.
      type(contact_qp_t), intent(in) :: qp
      !> Diagonal entries (n_rows) [length/force].
      real(dp), intent(out) :: diagonal(:)
    end subroutine nodal_diagonal_interface

    !> Costs of one body.
    subroutine get_costs_interface(self, b, path, solve)
      import :: compliance_t, dp
      !> The compliance of the bodies.
      class(compliance_t), intent(inout) :: self
      !> The body.
      integer, intent(in) :: b
      !> Entries of the factor on the elimination-tree path of a row [].
      real(dp), intent(out) :: path
      !> Entries of the factor that a solve goes through twice [].
      real(dp), intent(out) :: solve
    end subroutine get_costs_interface

    !> Mark rows with entries.
    subroutine mark_formed_interface(self, formed)
      import :: compliance_t
      !> The compliance of the bodies.
      class(compliance_t), intent(in) :: self
      !> Set true where entries are there, unchanged elsewhere (rows of the QP that all others are restrictions of).
      logical, intent(inout) :: formed(:)
    end subroutine mark_formed_interface

    !> Entries at all rows.
    subroutine form_all_interface(self, qp, entries)
      import :: compliance_t, contact_qp_t, entries_t
      !> The compliance of the bodies.
      class(compliance_t), intent(inout) :: self
      !> Any QP over the same bodies.
      type(contact_qp_t), intent(in) :: qp
      !> Entries of each body at its rows, in their order (n_bodies).
      type(entries_t), allocatable, intent(out) :: entries(:)
    end subroutine form_all_interface
  end interface

contains

  !> The energy norm of the difference of two states `u = u0 - K^+ B^T W m + R alpha`; one product.
  real(dp) function compliance_distance(self, qp, m, alpha) result(distance)
    !> The compliance of the bodies.
    class(compliance_t), intent(inout) :: self
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> Difference of the pressures (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> Difference of the amplitudes of the rigid body modes (coarse%n) [length].
    real(dp), intent(in) :: alpha(:)
    real(dp), allocatable :: z(:), amplitude(:)
    allocate (z(size(m)))
    call self%multiply(qp, qp%weight*m, z)
    amplitude = alpha/qp%coarse%scale
    distance = sqrt(max(0.0_dp, sum(qp%weight*m*z) + dot_product(amplitude, qp%coarse%stiffness_forces(amplitude))))
  end function compliance_distance
end module dotyk_scheme_compliance
