!> Facets of a surface that lie near another surface: the only ones that can be in contact.
!>
!> Where a body touches many others, or a large one a small one, most facets of a pair are farther from the other surface than
!> the search radius. They are told by their boxes, before anything is projected.
module dotyk_contact_broad_phase
  use dotyk_base_kinds, only: dp
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_tree_t
  implicit none
  private
  public :: facets_near_candidates, candidate_facets

  !> Partners along a smooth normal may be nearer than closest points by the height of a facet's arc, relative to its size.
  real(dp), parameter :: margin = 0.25_dp
  !> Greatest number of nodes that wait: the depth of a tree that halves is below 32.
  integer, parameter :: stack_size = 128

contains

  !> The facets whose box comes as near as a distance to the box of some facet of another surface, or a little less near.
  pure function candidate_facets(set, other, tree, distance) result(near)
    type(facet_set_t), intent(in) :: set
    !> The other surface and its tree.
    type(facet_set_t), intent(in) :: other
    type(bounding_volume_tree_t), intent(in) :: tree
    !> [length]
    real(dp), intent(in) :: distance
    !> (set%n).
    logical :: near(set%n)
    integer :: f
    do f = 1, set%n
      near(f) = is_near(other, tree, set%lo(:, f), set%hi(:, f), distance + margin*set%size(f))
    end do
  end function candidate_facets

  !> The facets that may be partners of some of another surface: by the box of all of these, with room for neighbours.
  pure function facets_near_candidates(set, other, near, distance) result(around)
    type(facet_set_t), intent(in) :: set
    !> The other surface, and its facets that count (n).
    type(facet_set_t), intent(in) :: other
    logical, intent(in) :: near(:)
    !> [length]
    real(dp), intent(in) :: distance
    !> (set%n).
    logical :: around(set%n)
    real(dp) :: low(3), high(3)
    integer :: f
    low = huge(low)
    high = -huge(high)
    do f = 1, other%n
      if (.not. near(f)) cycle
      low = min(low, other%lo(:, f) - distance)
      high = max(high, other%hi(:, f) + distance)
    end do
    do f = 1, set%n
      around(f) = all(set%hi(:, f) + set%size(f) >= low .and. set%lo(:, f) - set%size(f) <= high)
    end do
  end function facets_near_candidates

  !> Does the box of some facet come as near to a box as a distance?
  pure logical function is_near(other, tree, low, high, distance)
    type(facet_set_t), intent(in) :: other
    type(bounding_volume_tree_t), intent(in) :: tree
    !> The box (3) [length].
    real(dp), intent(in) :: low(3), high(3)
    !> [length]
    real(dp), intent(in) :: distance
    integer :: waiting(stack_size), n, node, i
    is_near = .false.
    n = min(1, other%n)
    waiting(1) = 1
    do while (n > 0)
      node = waiting(n)
      n = n - 1
      if (.not. touch(tree%lo(:, node), tree%hi(:, node))) cycle
      if (tree%child(node) > 0) then
        waiting(n + 1:n + 2) = [tree%child(node), tree%child(node) + 1]
        n = n + 2
        cycle
      end if
      do i = tree%first(node), tree%last(node)
        is_near = touch(other%lo(:, tree%order(i)), other%hi(:, tree%order(i)))
        if (is_near) return
      end do
    end do

  contains

    !> A box lies within the distance.
    pure logical function touch(lo, hi)
      real(dp), intent(in) :: lo(3), hi(3)
      touch = sum(max(lo - high, low - hi, 0.0_dp)**2) <= distance**2
    end function touch
  end function is_near
end module dotyk_contact_broad_phase
