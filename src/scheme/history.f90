!> What a scheme did, step by step.
module dotyk_scheme_history
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use dotyk_base_kinds, only: dp
  implicit none
  private

  integer, parameter :: n_measured = 11  !! Steps over which the contraction is measured, and the one before them.
  integer, parameter :: first_size = 128  !! Entries of new arrays; they double where they are full.

  type, public :: history_t  !! One entry per iteration; arrays are longer than `n` while the iteration goes on.
    integer :: n = 0  !! Number of entries.
    real(dp), allocatable :: seconds(:)  !! Wall time since the start of the scheme [s].
    real(dp), allocatable :: increment(:)  !! ||u^{k+1} - u^k||_G / ||u^{k+1}||_A, G = A but for the Robin scheme [].
    real(dp), allocatable :: error_bound(:)  !! Guaranteed bound of the relative error in the energy norm [].
    real(dp), allocatable :: error_bound_paper(:)  !! Bound (41) of the same error; NaN where there is none [].
    !> Relative errors of penalty and discretization, NaN where they were not estimated [].
    real(dp), allocatable :: error_penalty(:), error_discretization(:)
    real(dp), allocatable :: energy(:)  !! F_theta [energy].
    real(dp), allocatable :: max_penetration(:)  !! Largest penetration [length].
    integer, allocatable :: active(:)  !! Number of active contact rows.
    !> Lengths of the last steps in the norm of G, newest first [sqrt(energy)].
    real(dp), private :: length(n_measured) = 0
    !> Steps that `length` has seen: those of this iteration, without earlier ones that were put before it.
    integer, private :: n_lengths = 0
  contains
    procedure :: add => history_add
    procedure :: finish => history_finish
    procedure :: put_after => history_put_after
    procedure :: measured_contraction => history_measured_contraction
  end type history_t

contains

  !> Add an entry; `length` is the increment before it was divided by the norm of the iterate.
  subroutine history_add(self, seconds, length, increment, error_bound, energy, max_penetration, active, &
                         error_bound_paper)
    class(history_t), intent(inout) :: self
    !> As the components of `history_t`, of one step; the length [sqrt(energy)].
    real(dp), intent(in) :: seconds, length, increment, error_bound, energy, max_penetration
    integer, intent(in) :: active  !! Number of active contact rows.
    real(dp), intent(in), optional :: error_bound_paper  !! Bound (41); there is none if absent [].
    if (.not. allocated(self%seconds)) call resize(self, first_size)
    if (self%n == size(self%seconds)) call resize(self, 2*self%n)
    self%n = self%n + 1
    self%length = [length, self%length(:size(self%length) - 1)]
    self%n_lengths = self%n_lengths + 1
    self%seconds(self%n) = seconds
    self%increment(self%n) = increment
    self%error_bound(self%n) = error_bound
    self%error_bound_paper(self%n) = ieee_value(length, ieee_quiet_nan)
    if (present(error_bound_paper)) self%error_bound_paper(self%n) = error_bound_paper
    self%error_penalty(self%n) = ieee_value(length, ieee_quiet_nan)
    self%error_discretization(self%n) = ieee_value(length, ieee_quiet_nan)
    self%energy(self%n) = energy
    self%max_penetration(self%n) = max_penetration
    self%active(self%n) = active
  end subroutine history_add

  !> Cut the arrays to the entries that there are.
  subroutine history_finish(self)
    class(history_t), intent(inout) :: self
    call resize(self, self%n)
  end subroutine history_finish

  !> Put this history after an earlier one, both finished.
  subroutine history_put_after(self, earlier)
    class(history_t), intent(inout) :: self
    type(history_t), intent(in) :: earlier  !! History of the same scheme, ended before this one began.
    if (earlier%n == 0) return
    self%seconds = [earlier%seconds, earlier%seconds(earlier%n) + self%seconds]
    self%increment = [earlier%increment, self%increment]
    self%error_bound = [earlier%error_bound, self%error_bound]
    self%error_bound_paper = [earlier%error_bound_paper, self%error_bound_paper]
    self%error_penalty = [earlier%error_penalty, self%error_penalty]
    self%error_discretization = [earlier%error_discretization, self%error_discretization]
    self%energy = [earlier%energy, self%energy]
    self%max_penetration = [earlier%max_penetration, self%max_penetration]
    self%active = [earlier%active, self%active]
    self%n = earlier%n + self%n
  end subroutine history_put_after

  !> Arrays of another length.
  subroutine resize(self, length)
    class(history_t), intent(inout) :: self
    integer, intent(in) :: length  !! Entries of the new arrays, at least those in use.
    integer, allocatable :: active(:)
    call resize_real(self%seconds)
    call resize_real(self%increment)
    call resize_real(self%error_bound)
    call resize_real(self%error_bound_paper)
    call resize_real(self%error_penalty)
    call resize_real(self%error_discretization)
    call resize_real(self%energy)
    call resize_real(self%max_penetration)
    allocate (active(length), source=0)
    if (self%n > 0) active(:self%n) = self%active(:self%n)
    call move_alloc(active, self%active)
  contains
    !> One array.
    subroutine resize_real(values)
      !> One array of the history; the first `n` values stay (length) [any].
      real(dp), allocatable, intent(inout) :: values(:)
      real(dp), allocatable :: longer(:)
      allocate (longer(length), source=0.0_dp)
      if (self%n > 0) longer(:self%n) = values(:self%n)
      call move_alloc(longer, values)
    end subroutine resize_real
  end subroutine resize

  !> Mean factor between the last increments (up to ten of them); NaN where there are fewer than two.
  pure real(dp) function history_measured_contraction(self) result(q)
    class(history_t), intent(in) :: self
    integer :: span
    q = ieee_value(q, ieee_quiet_nan)
    span = min(size(self%length), self%n_lengths) - 1
    if (span < 1) return
    if (.not. self%length(span + 1) > 0) return
    q = (self%length(1)/self%length(span + 1))**(1.0_dp/span)
  end function history_measured_contraction
end module dotyk_scheme_history
