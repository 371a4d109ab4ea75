!> Contact pressures and tractions at nodes that several pairs have: at the edge between two of them each has the
!> pressure of its own part of the faces around the node.
module dotyk_control_nodal_pressures
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_base_thresholds, only: sharp_cosine
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_contact_pair, only: contact_pair_t
  implicit none
  private

  type, public :: nodal_pressures_t  !! What the pairs of one body have at its nodes.
    integer, private :: n = 0  !! Number of entries, in the order of the pairs.
    integer, allocatable, private :: node(:)  !! Node of each entry (n_allocated).
    !> Its pressure [pressure], and the weight of the pair around the node [as the weights of the pair] (n_allocated).
    real(dp), allocatable, private :: pressure(:), weight(:)
    real(dp), allocatable, private :: normal(:, :)  !! Its unit normal into the body (dim, n_allocated) [].
  contains
    procedure :: add => nodal_add
    procedure :: combine => nodal_combine
  end type nodal_pressures_t

contains

  !> Add one side of a pair.
  subroutine nodal_add(self, pair, side, sign, pressure)
    class(nodal_pressures_t), intent(inout) :: self
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(corner_interpolation_t), intent(in) :: side  !! Interpolation on this side.
    real(dp), intent(in) :: sign  !! -1 on body a, 1 on body b: from the normals of the pair to those into the body [].
    real(dp), intent(in) :: pressure(:)  !! Projected pressures at side%node (their number) [pressure].
    real(dp) :: corner(side%n), component(size(side%node)), normal(pair%dimension, size(side%node))
    integer :: c, i
    if (self%n == 0) then
      self%node = [integer ::]
      self%pressure = [real(dp) ::]
      self%weight = self%pressure
      allocate (self%normal(pair%dimension, 0))
    end if
    do c = 1, pair%dimension
      call side%moments(pair%weight*pair%normal(c, :), corner)
      call side%at_nodes(corner, component)
      normal(c, :) = component
    end do
    do i = 1, size(side%node)
      normal(:, i) = sign*normal(:, i)/max(norm2(normal(:, i)), tiny(sign))
    end do
    call side%moments(pair%weight, corner)
    call side%at_nodes(corner, component)
    self%n = self%n + size(side%node)
    self%node = [self%node, side%node]
    self%pressure = [self%pressure, pressure]
    self%weight = [self%weight, component]
    self%normal = reshape([self%normal, normal], [pair%dimension, self%n])
  end subroutine nodal_add

  !> Pressures and tractions of the nodes. Pairs with about the same normal at a node have the mean, by their weights;
  !> where faces meet at an edge the node has the greatest of their pressures, and the sum of their tractions.
  pure subroutine nodal_combine(self, pressure, traction)
    class(nodal_pressures_t), intent(in) :: self
    real(dp), intent(out) :: pressure(:)  !! Pressures; 0 at nodes without entries (n_nodes) [pressure].
    real(dp), intent(out) :: traction(:, :)  !! Tractions, likewise (dim, n_nodes) [pressure].
    integer :: order(self%n), group(self%n), i, j, k, first, last
    real(dp) :: p
    pressure = 0
    traction = 0
    if (self%n == 0) return
    call sort_order(self%node, order)
    group = 0
    last = 0
    do while (last < self%n)
      first = last + 1
      last = first
      do while (last < self%n)
        if (self%node(order(last + 1)) /= self%node(order(first))) exit
        last = last + 1
      end do
      associate (node => self%node(order(first)), entry => order(first:last))
        do i = 1, size(entry)
          j = 1
          do while (dot_product(self%normal(:, entry(j)), self%normal(:, entry(i))) < sharp_cosine .and. j < i)
            j = j + 1
          end do
          group(entry(i)) = i
          if (j < i) group(entry(i)) = group(entry(j))
        end do
        do i = 1, size(entry)
          if (.not. any(group(entry) == i)) cycle
          p = mean_of(pack(entry, group(entry) == i))
          if (abs(p) > abs(pressure(node))) pressure(node) = p
          do k = 1, size(entry)
            if (group(entry(k)) /= i) cycle
            traction(:, node) = traction(:, node) + p*self%normal(:, entry(k))
            exit
          end do
        end do
      end associate
    end do

  contains

    !> Mean pressure of some entries.
    pure real(dp) function mean_of(entry) result(mean)
      integer, intent(in) :: entry(:)  !! The entries, at least one (n).
      mean = self%pressure(entry(1))
      if (size(entry) == 1) return
      if (sum(self%weight(entry)) > 0) then
        mean = sum(self%weight(entry)*self%pressure(entry))/sum(self%weight(entry))
      else
        mean = sum(self%pressure(entry))/size(entry)
      end if
    end function mean_of
  end subroutine nodal_combine
end module dotyk_control_nodal_pressures
