!> Combinations of rigid body modes as sparse columns: of thousands of bodies most combinations move one body or a few.
module dotyk_scheme_mode_columns
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: sum_rounding
  use dotyk_scheme_coarse_space, only: mode_block_t
  implicit none
  private

  type, public :: mode_columns_t  !! The columns.
    integer :: n = 0  !! Number of columns.
    !> Entries of column k are first(k) .. first(k+1)-1; longer than needed (at least n + 1).
    integer, allocatable, private :: first(:)
    integer, allocatable, private :: mode(:)  !! Mode of each entry; longer than needed (at least number of entries).
    real(dp), allocatable, private :: value(:)  !! Amplitude of each entry (as `mode`) [any].
  contains
    procedure :: add => columns_add
    procedure :: get => columns_get
    procedure :: scale => columns_scale
    procedure :: by_bodies => columns_by_bodies
    procedure :: destroy => columns_destroy
  end type mode_columns_t

contains

  !> Append a column; entries that are rounding errors are left out.
  subroutine columns_add(self, x, offset)
    class(mode_columns_t), intent(inout) :: self
    real(dp), intent(in) :: x(:)  !! Amplitudes of successive modes (m) [any].
    integer, intent(in), optional :: offset  !! Modes before the first of them; none if absent.
    real(dp) :: least
    integer :: i, before, last
    before = 0
    if (present(offset)) before = offset
    if (.not. allocated(self%first)) allocate (self%first(2), self%mode(0), self%value(0))
    if (self%n == 0) self%first(1) = 1
    if (size(self%first) < self%n + 2) self%first = [self%first, self%first]
    last = self%first(self%n + 1) - 1
    least = sum_rounding*maxval([0.0_dp, abs(x)])
    do i = 1, size(x)
      if (.not. abs(x(i)) > least) cycle
      last = last + 1
      if (last > size(self%mode)) then
        self%mode = [self%mode, self%mode, 0]
        self%value = [self%value, self%value, 0.0_dp]
      end if
      self%mode(last) = before + i
      self%value(last) = x(i)
    end do
    self%n = self%n + 1
    self%first(self%n + 1) = last + 1
  end subroutine columns_add

  !> One column.
  pure subroutine columns_get(self, k, x)
    class(mode_columns_t), intent(in) :: self
    integer, intent(in) :: k  !! Its number.
    real(dp), intent(out) :: x(:)  !! Amplitudes of all modes (n_modes) [any].
    x = 0
    associate (first => self%first(k), last => self%first(k + 1) - 1)
      x(self%mode(first:last)) = self%value(first:last)
    end associate
  end subroutine columns_get

  !> Multiply the amplitudes of each mode by a number of its own.
  pure subroutine columns_scale(self, factor)
    class(mode_columns_t), intent(inout) :: self
    real(dp), intent(in) :: factor(:)  !! By modes (n_modes) [any].
    if (self%n == 0) return
    associate (last => self%first(self%n + 1) - 1)
      self%value(:last) = factor(self%mode(:last))*self%value(:last)
    end associate
  end subroutine columns_scale

  !> The rows of each body, without the columns that do not move it.
  subroutine columns_by_bodies(self, first, block)
    class(mode_columns_t), intent(in) :: self
    integer, intent(in) :: first(:)  !! Modes of body b are first(b) .. first(b+1)-1 (n_bodies + 1).
    type(mode_block_t), allocatable, intent(out) :: block(:)  !! Amplitudes of its modes as columns (n_bodies) [any].
    integer :: n_columns(size(first) - 1), latest(size(first) - 1), body(first(size(first)) - 1), b, i, k, pass
    do b = 1, size(first) - 1
      body(first(b):first(b + 1) - 1) = b
    end do
    allocate (block(size(first) - 1))
    ! Columns are counted, then filled.
    do pass = 1, 2
      n_columns = 0
      latest = 0
      do k = 1, self%n
        do i = self%first(k), self%first(k + 1) - 1
          b = body(self%mode(i))
          if (latest(b) /= k) n_columns(b) = n_columns(b) + 1
          latest(b) = k
          if (pass == 2) block(b)%value(self%mode(i) - first(b) + 1, n_columns(b)) = self%value(i)
        end do
      end do
      if (pass == 2) exit
      do b = 1, size(block)
        allocate (block(b)%value(first(b + 1) - first(b), n_columns(b)), source=0.0_dp)
      end do
    end do
  end subroutine columns_by_bodies

  !> Free all memory.
  subroutine columns_destroy(self)
    class(mode_columns_t), intent(inout) :: self
    self%n = 0
    if (allocated(self%first)) deallocate (self%first, self%mode, self%value)
  end subroutine columns_destroy
end module dotyk_scheme_mode_columns
