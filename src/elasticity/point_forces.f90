!> Loads as forces at points of elements: the functional L(v) of any displacement v, not of those of the mesh alone.
!>
!> Each is the value of a load at a quadrature point times the weight of the point. Resultants are sums of them, and the
!> residuals of elements (`dotyk_elasticity_element_residual`) take them on functions that no node carries.
module dotyk_elasticity_point_forces
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  implicit none
  private

  type, public :: point_forces_t  !! Forces on one body.
    integer :: n = 0  !! Number of forces.
    integer, allocatable :: element(:)  !! Element of each, in the order of the blocks (>= n).
    integer, allocatable :: face(:)  !! Face of that element, 0 for its volume (>= n).
    real(dp), allocatable :: xi(:, :)  !! Reference coordinates in the element (dim, >= n) [].
    real(dp), allocatable :: force(:, :)  !! Forces (dim, >= n) [force].
  contains
    procedure :: add => point_forces_add
    procedure :: by_element => point_forces_by_element
    procedure :: hold => point_forces_hold
    procedure :: carry => point_forces_carry
  end type point_forces_t

contains

  !> Add a force.
  pure subroutine point_forces_add(self, element, face, xi, force)
    class(point_forces_t), intent(inout) :: self
    integer, intent(in) :: element  !! Element, in the order of the blocks.
    integer, intent(in) :: face  !! Its face, 0 for its volume.
    real(dp), intent(in) :: xi(:)  !! Reference coordinates (dim) [].
    real(dp), intent(in) :: force(:)  !! The force (dim) [force].
    integer, allocatable :: wider(:)
    real(dp), allocatable :: table(:, :)
    integer :: room
    if (.not. allocated(self%element)) then
      allocate (self%element(64), self%face(64), self%xi(size(xi), 64), self%force(size(xi), 64))
    else if (self%n == size(self%element)) then
      room = max(64, 2*self%n)
      allocate (wider(room), source=0)
      wider(:self%n) = self%element
      self%element = wider
      wider(:self%n) = self%face
      call move_alloc(wider, self%face)
      allocate (table(size(xi), room), source=0.0_dp)
      table(:, :self%n) = self%xi
      self%xi = table
      table(:, :self%n) = self%force
      call move_alloc(table, self%force)
    end if
    self%n = self%n + 1
    self%element(self%n) = element
    self%face(self%n) = face
    self%xi(:, self%n) = xi
    self%force(:, self%n) = force
  end subroutine point_forces_add

  !> Keep the forces on some elements.
  pure subroutine point_forces_hold(self, number)
    class(point_forces_t), intent(inout) :: self
    integer, intent(in) :: number(:)  !! New number of each element, 0 where it is not held (n_elements).
    integer, allocatable :: chosen(:)
    integer :: i
    if (self%n == 0) return
    chosen = pack([(i, i=1, self%n)], number(self%element(:self%n)) > 0)
    self%n = size(chosen)
    self%element = number(self%element(chosen))
    self%face = self%face(chosen)
    self%xi = self%xi(:, chosen)
    self%force = self%force(:, chosen)
  end subroutine point_forces_hold

  !> The forces of element e are those of indices order(first(e) : first(e + 1) - 1).
  pure subroutine point_forces_by_element(self, n_elements, first, order)
    class(point_forces_t), intent(in) :: self
    integer, intent(in) :: n_elements  !! Number of elements of the body.
    integer, allocatable, intent(out) :: first(:)  !! First entry of each element in `order` (n_elements + 1).
    integer, allocatable, intent(out) :: order(:)  !! Forces, one element after the other (n).
    integer, allocatable :: next(:)
    integer :: i
    allocate (first(n_elements + 1), source=0)
    allocate (order(self%n))
    do i = 1, self%n
      first(self%element(i) + 1) = first(self%element(i) + 1) + 1
    end do
    first(1) = 1
    do i = 1, n_elements
      first(i + 1) = first(i) + first(i + 1)
    end do
    next = first
    do i = 1, self%n
      associate (e => self%element(i))
        order(next(e)) = i
        next(e) = next(e) + 1
      end associate
    end do
  end subroutine point_forces_by_element

  !> Put the forces into a parcel, or take them out.
  subroutine point_forces_carry(self, parcel)
    class(point_forces_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%n)
    if (.not. parcel%is_read .and. self%n > 0) then
      ! Without room for more.
      self%element = self%element(:self%n)
      self%face = self%face(:self%n)
      self%xi = self%xi(:, :self%n)
      self%force = self%force(:, :self%n)
    end if
    call parcel%carry(self%element)
    call parcel%carry(self%face)
    call parcel%carry(self%xi)
    call parcel%carry(self%force)
  end subroutine point_forces_carry
end module dotyk_elasticity_point_forces
