!> Memory that may be taken for what is kept to save time.
module dotyk_base_allowance
  use dotyk_base_kinds, only: int64
  implicit none
  private

  type, public :: allowance_t  !! An allowance; nothing at first.
    integer(int64) :: left = 0  !! Memory that may still be taken [bytes].
  contains
    procedure :: take => allowance_take
  end type allowance_t

contains

  !> Take memory where there is enough, from any thread; whether there is.
  logical function allowance_take(self, bytes) result(granted)
    class(allowance_t), intent(inout) :: self
    integer(int64), intent(in) :: bytes  !! Memory [bytes].
    !$omp critical (allowance)
    granted = self%left >= bytes
    if (granted) self%left = self%left - bytes
    !$omp end critical (allowance)
  end function allowance_take
end module dotyk_base_allowance
