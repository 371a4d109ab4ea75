!> The compliance operator C = B K^+ B^T of all bodies at the rows of a contact QP, as the schemes see it.
!>
!> B lives in the QP (`dotyk_scheme_contact_qp`), K^+ here; a restriction of a QP to some of its rows, or an aggregation
!> of them, is passed to the same operator. Products are always possible. Entries are where they were formed: what forms
!> them, and what it costs, is up to the extension (`dotyk_scheme_dense_compliance`, `dotyk_scheme_body_compliance`).
module dotyk_scheme_compliance
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: drop_rigid_constraints

  type, public :: entries_t  !! Entries of C between some rows of one body.
    real(dp), allocatable :: value(:, :)  !! (n, n), symmetric [length/force].
  end type entries_t

  type, abstract, public :: compliance_t  !! The operator.
    !> Solves of every body so far: products without entries, and what forming entries costs in such solves.
    integer :: n_sweeps = 0
  contains
    procedure(multiply_interface), deferred :: multiply  !! z = C lambda.
    procedure(form_interface), deferred :: form  !! Form the entries at all rows of a QP.
    procedure(is_formed_interface), deferred :: is_formed  !! Whether all entries at the rows of a QP are there.
    procedure(has_entries_interface), deferred :: has_entries  !! Whether entries at any rows are there.
    procedure(get_entries_interface), deferred :: get_entries  !! Entries between some rows of one body.
    procedure(get_diagonal_interface), deferred :: get_diagonal  !! Diagonal entries at some rows.
    procedure(nodal_diagonal_interface), deferred :: nodal_diagonal  !! An approximate diagonal that needs no entries.
    !> What a row of entries, and a product without entries, cost.
    procedure(get_costs_interface), deferred :: get_costs
    !> Rows of which the entries are there, of the QP that all others are restrictions of.
    procedure(mark_formed_interface), deferred :: mark_formed
    !> All entries at the rows of a QP that need not be a restriction, body by body.
    procedure(form_all_interface), deferred :: form_all
    procedure :: distance => compliance_distance  !! Energy norm of a difference of two states.
  end type compliance_t

  abstract interface
    !> z = C lambda.
    subroutine multiply_interface(self, qp, lambda, z)
      import :: compliance_t, contact_qp_t, dp
      class(compliance_t), intent(inout) :: self
      type(contact_qp_t), intent(in) :: qp  !! The rows.
      real(dp), intent(in) :: lambda(:)  !! Contact forces, weights included (n_rows) [force].
      real(dp), intent(out) :: z(:)  !! Normal displacements of the rows (n_rows) [length].
    end subroutine multiply_interface

    !> Form entries.
    subroutine form_interface(self, qp, may_stop)
      import :: compliance_t, contact_qp_t
      class(compliance_t), intent(inout) :: self
      type(contact_qp_t), intent(in) :: qp  !! The rows.
      !> Whether an interrupt ends it, with entries that are not valid; not if absent.
      logical, intent(in), optional :: may_stop
    end subroutine form_interface

    !> Whether all entries are there.
    pure logical function is_formed_interface(self, qp)
      import :: compliance_t, contact_qp_t
      class(compliance_t), intent(in) :: self
      type(contact_qp_t), intent(in) :: qp  !! The rows.
    end function is_formed_interface

    !> Whether any entries are there.
    pure logical function has_entries_interface(self)
      import :: compliance_t
      class(compliance_t), intent(in) :: self
    end function has_entries_interface

    !> Entries of one body's part of C.
    subroutine get_entries_interface(self, qp, b, row, entries)
      import :: compliance_t, contact_qp_t, dp
      class(compliance_t), intent(in) :: self
      type(contact_qp_t), intent(in) :: qp  !! Formed.
      integer, intent(in) :: b  !! The body.
      integer, intent(in) :: row(:)  !! Rows of the QP that touch the body (n).
      real(dp), allocatable, intent(out) :: entries(:, :)  !! Entries (n, n) [length/force].
    end subroutine get_entries_interface

    !> Diagonal of C.
    subroutine get_diagonal_interface(self, qp, row, diagonal)
      import :: compliance_t, contact_qp_t, dp
      class(compliance_t), intent(in) :: self
      type(contact_qp_t), intent(in) :: qp  !! Formed at the rows.
      integer, intent(in) :: row(:)  !! Some of its rows (n).
      real(dp), intent(out) :: diagonal(:)  !! Diagonal entries (n) [length/force].
    end subroutine get_diagonal_interface

    !> `B D^{-1} B^T`, D the diagonal of the stiffness: each row with its nodes alone.
    subroutine nodal_diagonal_interface(self, qp, diagonal)
      import :: compliance_t, contact_qp_t, dp
      class(compliance_t), intent(in) :: self
      type(contact_qp_t), intent(in) :: qp  !! The rows.
      real(dp), intent(out) :: diagonal(:)  !! Diagonal entries (n_rows) [length/force].
    end subroutine nodal_diagonal_interface

    !> Costs of one body.
    subroutine get_costs_interface(self, b, path, solve)
      import :: compliance_t, dp
      class(compliance_t), intent(inout) :: self
      integer, intent(in) :: b  !! The body.
      real(dp), intent(out) :: path  !! Entries of the factor on the elimination-tree path of a row [].
      real(dp), intent(out) :: solve  !! Entries of the factor that a solve goes through twice [].
    end subroutine get_costs_interface

    !> Mark rows with entries.
    subroutine mark_formed_interface(self, formed)
      import :: compliance_t
      class(compliance_t), intent(in) :: self
      !> Set true where entries are there, unchanged elsewhere (rows of the QP that all others are restrictions of).
      logical, intent(inout) :: formed(:)
    end subroutine mark_formed_interface

    !> Entries at all rows.
    subroutine form_all_interface(self, qp, entries)
      import :: compliance_t, contact_qp_t, entries_t
      class(compliance_t), intent(inout) :: self
      type(contact_qp_t), intent(in) :: qp  !! Any QP over the same bodies.
      !> Entries of each body at its rows, in their order (n_bodies).
      type(entries_t), allocatable, intent(out) :: entries(:)
    end subroutine form_all_interface
  end interface

contains

  !> The energy norm of the difference of two states `u = u0 - K^+ B^T W m + R alpha`; one product.
  real(dp) function compliance_distance(self, qp, pressure, alpha) result(distance)
    class(compliance_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    real(dp), intent(in) :: pressure(:)  !! Difference of the pressures (n_rows) [pressure].
    real(dp), intent(in) :: alpha(:)  !! Difference of the amplitudes of the rigid body modes (coarse%n) [length].
    real(dp), allocatable :: z(:), amplitude(:)
    allocate (z(size(pressure)))
    call self%multiply(qp, qp%weight*pressure, z)
    amplitude = alpha/qp%coarse%scale
    distance = sqrt(max(0.0_dp, sum(qp%weight*pressure*z) + &
                        dot_product(amplitude, qp%coarse%stiffness_forces(amplitude))))
  end function compliance_distance

  !> Take rigid constraints out of the active set: rows that no force moves, because all their nodes are held by
  !> supports.
  subroutine drop_rigid_constraints(qp, compliance, yields, active, is_rigid)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    !> Work space: how much each row yields, where entries of C are not formed (n_rows) [length].
    real(dp), allocatable, intent(inout) :: yields(:)
    logical, intent(inout) :: active(:)  !! Active set (n_rows).
    logical, intent(inout) :: is_rigid(:)  !! Grows (n_rows).
    real(dp), allocatable :: diagonal(:), g(:, :)
    integer, allocatable :: row(:)
    real(dp) :: largest
    integer :: i
    if (.not. any(active .and. .not. qp%theta > 0)) return
    row = pack([(i, i=1, size(active))], active)
    allocate (diagonal(size(row)))
    allocate (g(1, qp%coarse%n))
    if (compliance%is_formed(qp)) then
      call compliance%get_diagonal(qp, row, diagonal)
    else
      if (.not. allocated(yields)) call press_all(qp, compliance, yields)
      diagonal = yields(row)
    end if
    largest = maxval(diagonal)
    do i = 1, size(row)
      if (diagonal(i) > rounding*largest .or. qp%theta(row(i)) > 0) cycle
      call qp%coarse%rows([row(i)], g)
      ! Modes are scaled to 1.
      if (any(abs(g) > rounding)) cycle
      active(row(i)) = .false.
      is_rigid(row(i)) = .true.
    end do
  end subroutine drop_rigid_constraints

  !> How much all rows yield to forces without any order, by one product: only rigid ones stay where they are.
  subroutine press_all(qp, compliance, yields)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    real(dp), allocatable, intent(out) :: yields(:)  !! Displacements of the rows, without sign (n_rows) [length].
    integer :: i
    allocate (yields(qp%n_rows))
    call compliance%multiply(qp, [(1 + 0.5_dp*sin(real(i, dp)**2), i=1, qp%n_rows)], yields)
    yields = abs(yields)
  end subroutine press_all
end module dotyk_scheme_compliance
