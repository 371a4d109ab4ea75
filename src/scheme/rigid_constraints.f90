!> Contact rows that no force moves, because all their nodes are held by supports. Without penalty they are constraints
!> of nothing: their part of the active system is zero.
module dotyk_scheme_rigid_constraints
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: drop_rigid_constraints

contains

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
end module dotyk_scheme_rigid_constraints
