!> Fill-reducing orderings by METIS's nested dissection. The only module that names METIS.
module dotyk_linalg_ordering
  use, intrinsic :: iso_c_binding, only: c_int, c_int32_t, c_loc, c_null_ptr, c_ptr
  use dotyk_base_error, only: error_t, set_error, exit_machine, exit_not_solvable
  use dotyk_base_text, only: to_text
  implicit none
  private
  public :: nested_dissection, expand_permutation, is_permutation

  !> Graphs of fewer nodes keep their order: there is nothing to gain.
  integer, parameter :: least_nodes = 50
  ! Positions in METIS 5.1's array of options, counted from 1, and what METIS_NodeND returns.
  integer, parameter :: n_options = 40
  integer, parameter :: option_seed = 9
  integer, parameter :: metis_ok = 1, metis_error_memory = -3

  interface
    integer(c_int) function metis_set_default_options(options) bind(c, name='METIS_SetDefaultOptions')
      import :: c_int, c_int32_t
      integer(c_int32_t), intent(out) :: options(*)
    end function metis_set_default_options

    integer(c_int) function metis_node_nd(n, start, neighbour, weight, options, permutation, inverse) &
      bind(c, name='METIS_NodeND')
      import :: c_int, c_int32_t, c_ptr
      integer(c_int32_t), intent(in) :: n
      integer(c_int32_t), intent(inout) :: start(*), neighbour(*)
      type(c_ptr), value :: weight
      integer(c_int32_t), intent(in) :: options(*)
      integer(c_int32_t), intent(out) :: permutation(*), inverse(*)
    end function metis_node_nd
  end interface

contains

  !> Nested dissection of a graph. The same graph and seed give the same ordering, whatever else runs at the same time.
  subroutine nested_dissection(start, neighbour, permutation, error, seed, weight)
    !> Position of the first neighbour of each node (n+1), 1-based.
    integer, intent(in) :: start(:)
    !> Neighbours of each node, without the node itself; the graph is symmetric.
    integer, intent(in) :: neighbour(:)
    !> The node that comes k-th (n).
    integer, intent(out) :: permutation(:)
    !> METIS has no memory, or refuses the graph.
    type(error_t), allocatable, intent(out) :: error
    !> Seed of METIS's random numbers; a fixed one if absent.
    integer, intent(in), optional :: seed
    !> Equations of each node, where they differ: nodes that part the graph have few in all (n).
    integer, intent(in), optional :: weight(:)
    integer(c_int32_t), allocatable, target :: weight_c(:)
    type(c_ptr) :: weights
    integer(c_int32_t), allocatable :: start_c(:), neighbour_c(:), permutation_c(:), inverse(:)
    integer(c_int32_t) :: options(n_options)
    integer(c_int) :: status
    integer :: n, i
    n = size(start) - 1
    permutation = [(i, i=1, n)]
    ! METIS 5.1 does not survive a graph without edges.
    if (n < least_nodes .or. size(neighbour) == 0) return
    ! METIS works on its own 0-based copies; it may write to them.
    allocate (start_c(n + 1), neighbour_c(size(neighbour)), permutation_c(n), inverse(n))
    start_c = int(start, c_int32_t) - 1_c_int32_t
    neighbour_c = int(neighbour, c_int32_t) - 1_c_int32_t
    weights = c_null_ptr
    if (present(weight)) then
      weight_c = int(weight, c_int32_t)
      weights = c_loc(weight_c)
    end if
    ! libmetis draws from the C library's rand(), which all threads share.
    !$omp critical(dotyk_metis)
    status = metis_set_default_options(options)
    options(option_seed) = 1
    if (present(seed)) options(option_seed) = int(seed, c_int32_t)
    status = metis_node_nd(int(n, c_int32_t), start_c, neighbour_c, weights, options, permutation_c, inverse)
    !$omp end critical(dotyk_metis)
    if (status == metis_ok) then
      permutation = int(permutation_c) + 1
      return
    end if
    !$omp critical (message)
    if (status == metis_error_memory) then
      call set_error(error, 'out of memory while ordering '//to_text(n)//' nodes', exit_machine)
    else
      call set_error(error, 'METIS cannot order the graph of '//to_text(n)//' nodes (status '//to_text(int(status))// &
        ')', exit_not_solvable)
    end if
    !$omp end critical (message)
  end subroutine nested_dissection

  !> Ordering of equations from an ordering of nodes: the equations of a node stay together.
  pure subroutine expand_permutation(node_permutation, equation, permutation)
    !> The node that comes k-th (n_nodes).
    integer, intent(in) :: node_permutation(:)
    !> Equation of each component of each node (dimension, n_nodes), 0 where there is none.
    integer, intent(in) :: equation(:, :)
    !> The equation that comes k-th (number of equations).
    integer, intent(out) :: permutation(:)
    integer :: i, k, n
    n = 0
    do k = 1, size(node_permutation)
      do i = 1, size(equation, 1)
        if (equation(i, node_permutation(k)) == 0) cycle
        n = n + 1
        permutation(n) = equation(i, node_permutation(k))
      end do
    end do
  end subroutine expand_permutation

  !> Whether each of 1..n stands in the list once.
  pure logical function is_permutation(n, list)
    integer, intent(in) :: n
    !> The list.
    integer, intent(in) :: list(:)
    logical, allocatable :: seen(:)
    integer :: k
    is_permutation = size(list) == n
    if (.not. is_permutation) return
    allocate (seen(n), source=.false.)
    do k = 1, n
      if (list(k) < 1 .or. list(k) > n) then
        is_permutation = .false.
      else if (seen(list(k))) then
        is_permutation = .false.
      else
        seen(list(k)) = .true.
      end if
    end do
  end function is_permutation
end module dotyk_linalg_ordering
