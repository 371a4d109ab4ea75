!> Fill-reducing orders by nested dissection, and partitions of meshes, with METIS (G. Karypis and V. Kumar, SIAM J.
!> Sci. Comput. 20, 1998), which is declared here and nowhere else.
module dotyk_linalg_ordering
  use, intrinsic :: iso_c_binding, only: c_float, c_int, c_int32_t, c_loc, c_null_ptr, c_ptr
  use dotyk_base_error, only: error_t, set_error, exit_machine, exit_not_solvable
  use dotyk_base_text, only: to_text
  implicit none
  private
  public :: nested_dissection, partition_elements, expand_permutation, is_permutation

  integer, parameter :: least_nodes = 50  !! Smaller graphs keep their order: factors are nearly dense in any.
  integer, parameter :: n_options = 40  !! Length of METIS 5.1's array of options.
  integer, parameter :: option_seed = 9  !! Position of the seed in that array, from 1.
  integer, parameter :: metis_ok = 1  !! METIS_NodeND succeeded.
  integer, parameter :: metis_error_memory = -3  !! METIS_NodeND had no memory.

  interface
    !> Set all options to their defaults.
    integer(c_int) function metis_set_default_options(options) bind(c, name='METIS_SetDefaultOptions')
      import :: c_int, c_int32_t
      integer(c_int32_t), intent(out) :: options(*)  !! Options (n_options).
    end function metis_set_default_options

    !> Nested dissection of a graph with 0-based numbers.
    integer(c_int) function metis_node_nd(n, start, neighbour, weight, options, permutation, inverse) &
      bind(c, name='METIS_NodeND')
      import :: c_int, c_int32_t, c_ptr
      integer(c_int32_t), intent(in) :: n  !! Number of nodes.
      integer(c_int32_t), intent(inout) :: start(*)  !! Position of the first neighbour of each node (n+1).
      integer(c_int32_t), intent(inout) :: neighbour(*)  !! Neighbours of the nodes.
      type(c_ptr), value :: weight  !! Address of the weights of the nodes (n), or null.
      integer(c_int32_t), intent(in) :: options(*)  !! Options (n_options).
      integer(c_int32_t), intent(out) :: permutation(*)  !! Node that is eliminated k-th (n).
      integer(c_int32_t), intent(out) :: inverse(*)  !! Position of each node in that order (n).
    end function metis_node_nd

    !> Partition of the graph of elements that have some nodes in common, with 0-based numbers.
    integer(c_int) function metis_part_mesh_dual(n_elements, n_nodes, start, node, weight, sizes, n_common, n_parts, &
                                                 fraction, options, cut, part, part_of_node) &
      bind(c, name='METIS_PartMeshDual')
      import :: c_float, c_int, c_int32_t, c_ptr
      integer(c_int32_t), intent(in) :: n_elements, n_nodes  !! Number of elements, and of nodes.
      integer(c_int32_t), intent(inout) :: start(*)  !! Position of the first node of each element (n_elements + 1).
      integer(c_int32_t), intent(inout) :: node(*)  !! Nodes of the elements.
      integer(c_int32_t), intent(in) :: weight(*)  !! Weights of the elements (n_elements).
      type(c_ptr), value :: sizes  !! Null.
      integer(c_int32_t), intent(in) :: n_common  !! Nodes that neighbours have in common, at least.
      integer(c_int32_t), intent(in) :: n_parts  !! Number of parts.
      real(c_float), intent(in) :: fraction(*)  !! Fraction of the weight of each part (n_parts).
      integer(c_int32_t), intent(in) :: options(*)  !! Options (n_options).
      integer(c_int32_t), intent(out) :: cut  !! Number of neighbours in other parts.
      integer(c_int32_t), intent(out) :: part(*)  !! Part of each element (n_elements).
      integer(c_int32_t), intent(out) :: part_of_node(*)  !! Part of each node (n_nodes).
    end function metis_part_mesh_dual
  end interface

contains

  !> Partition elements so that few of them have neighbours in other parts.
  subroutine partition_elements(start, node, n_nodes, n_common, weight, fraction, part, error)
    integer, intent(in) :: start(:)  !! Position of the first node of each element (n_elements + 1), 1-based.
    integer, intent(in) :: node(:)  !! Nodes of the elements (start(n_elements + 1) - 1).
    integer, intent(in) :: n_nodes  !! Number of nodes.
    integer, intent(in) :: n_common  !! Nodes that neighbours have in common, at least.
    integer, intent(in) :: weight(:)  !! Weights of the elements (n_elements).
    real, intent(in) :: fraction(:)  !! Fraction of the weight that each part should have; their sum is 1 (n_parts).
    integer, intent(out) :: part(:)  !! Part of each element, from 1 (n_elements).
    type(error_t), allocatable, intent(out) :: error  !! METIS has no memory, or refuses the mesh.
    integer(c_int32_t), allocatable :: start_c(:), node_c(:), part_c(:), part_of_node(:)
    integer(c_int32_t) :: options(n_options), cut
    integer(c_int) :: status
    part = 1
    if (size(fraction) == 1 .or. size(weight) < 2) return
    allocate (part_c(size(weight)), part_of_node(n_nodes))
    start_c = int(start, c_int32_t) - 1_c_int32_t
    node_c = int(node, c_int32_t) - 1_c_int32_t
    !$omp critical(dotyk_metis)
    status = metis_set_default_options(options)
    options(option_seed) = 1
    status = metis_part_mesh_dual(int(size(weight), c_int32_t), int(n_nodes, c_int32_t), start_c, node_c, &
                                  int(weight, c_int32_t), c_null_ptr, int(n_common, c_int32_t), &
                                  int(size(fraction), c_int32_t), real(fraction, c_float), options, cut, part_c, &
                                  part_of_node)
    !$omp end critical(dotyk_metis)
    if (status /= metis_ok) then
      call set_error(error, 'METIS cannot divide a mesh of '//to_text(size(weight))//' elements (its status is '// &
                     to_text(int(status))//'; -3: out of memory)', exit_machine)
    else
      part = part_c + 1
    end if
  end subroutine partition_elements

  !> Nested dissection of a graph. The same graph and seed give the same order, whatever other threads do.
  subroutine nested_dissection(start, neighbour, permutation, error, seed, weight)
    integer, intent(in) :: start(:)  !! Position of the first neighbour of each node (n+1), 1-based.
    !> Neighbours of each node, without the node itself; the graph is symmetric (number of neighbours of all nodes).
    integer, intent(in) :: neighbour(:)
    integer, intent(out) :: permutation(:)  !! Node that is eliminated k-th (n).
    type(error_t), allocatable, intent(out) :: error  !! METIS has no memory, or refuses the graph.
    integer, intent(in), optional :: seed  !! Seed of METIS's random numbers; a fixed one if absent.
    !> Number of equations of each node, which separators minimize (n); all equal if absent.
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
    ! METIS may write to its arguments.
    allocate (start_c(n + 1), neighbour_c(size(neighbour)), permutation_c(n), inverse(n))
    start_c = int(start, c_int32_t) - 1_c_int32_t
    neighbour_c = int(neighbour, c_int32_t) - 1_c_int32_t
    weights = c_null_ptr
    if (present(weight)) then
      weight_c = int(weight, c_int32_t)
      weights = c_loc(weight_c)
    end if
    ! METIS uses the C library's rand(), whose state all threads share.
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
      call set_error(error, 'METIS cannot order the graph of '//to_text(n)//' nodes (status '// &
                     to_text(int(status))//')', exit_not_solvable)
    end if
    !$omp end critical (message)
  end subroutine nested_dissection

  !> Order of equations from an order of nodes; the equations of a node stay together.
  pure subroutine expand_permutation(node_permutation, equation, permutation)
    integer, intent(in) :: node_permutation(:)  !! Node that is eliminated k-th (n_nodes).
    integer, intent(in) :: equation(:, :)  !! Equation of each component of each node (dimension, n_nodes), or 0.
    integer, intent(out) :: permutation(:)  !! Equation that is eliminated k-th (number of equations).
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

  !> Whether a list contains each of 1..n once.
  pure logical function is_permutation(n, list)
    integer, intent(in) :: n  !! Greatest number.
    integer, intent(in) :: list(:)  !! The list (any length).
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
