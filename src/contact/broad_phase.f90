!> Broad phase of the contact search: the candidate facets, those whose bounding boxes are within the search radius of
!> the other surface (bounding-volume tree; cf. Yang and Laursen, Comput. Mech. 41, 2008). The narrow phase, clipping
!> and projection, examines no other facets.
!>
!> Where a body touches many others, or a large body a small one, most facets of a pair are no candidates.
module dotyk_contact_broad_phase
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_tree_t
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_tree_search, only: box_neighbourhood_t, tree_walk_t
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: candidate_facets, facets_near_candidates, overlapping_boxes

  !> Projections along a smooth normal may be nearer than closest points by the height of the arc of a facet, relative
  !> to its size.
  real(dp), parameter :: arc_margin = 0.25_dp

contains

  !> Facets whose bounding box is within a distance, and a margin for curved facets, of the box of a facet of another
  !> surface.
  subroutine candidate_facets(division, set, tree, distance, candidate)
    type(division_t), intent(in) :: division  !! How ranks divide the facets.
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(bounding_volume_tree_t), intent(in) :: tree  !! Bounding-volume tree of the other surface.
    real(dp), intent(in) :: distance  !! Distance [length].
    logical, intent(out) :: candidate(:)  !! Candidates (set%n).
    type(box_neighbourhood_t) :: region
    type(tree_walk_t) :: walk
    integer :: f, near, first, last
    call division%portion(set%n, first, last)
    do f = first, last
      region%low = set%lo(:, f)
      region%high = set%hi(:, f)
      region%distance = distance + arc_margin*set%size(f)
      call walk%start(tree)
      call walk%next(tree, region, near)
      candidate(f) = near > 0
    end do
    call division%fill(candidate, first, last)
  end subroutine candidate_facets

  !> Facets that may carry projections of the candidates of another surface: those in the common box of all candidates,
  !> widened by the distance and, for the neighbours that smooth normals depend on, by their own size.
  pure function facets_near_candidates(set, other, candidate, distance) result(near)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(facet_set_t), intent(in) :: other  !! Facets of the other surface.
    logical, intent(in) :: candidate(:)  !! Candidates of the other surface (other%n).
    real(dp), intent(in) :: distance  !! Distance [length].
    logical :: near(set%n)  !! Facets in the box (set%n).
    real(dp) :: low(3), high(3)
    integer :: f
    low = huge(low)
    high = -huge(high)
    do f = 1, other%n
      if (.not. candidate(f)) cycle
      low = min(low, other%lo(:, f) - distance)
      high = max(high, other%hi(:, f) + distance)
    end do
    do f = 1, set%n
      near(f) = all(set%hi(:, f) + set%size(f) >= low .and. set%lo(:, f) - set%size(f) <= high)
    end do
  end function facets_near_candidates

  !> Couples of boxes that overlap, and each box with itself, by their lower corners in x.
  pure subroutine overlapping_boxes(lo, hi, couple)
    real(dp), intent(in) :: lo(:, :)  !! Lower corners (3, n) [length].
    real(dp), intent(in) :: hi(:, :)  !! Upper corners (3, n) [length].
    integer, allocatable, intent(out) :: couple(:, :)  !! Numbers of the boxes, the lower one first (2, n_couples).
    integer, allocatable :: found(:, :), more(:, :)
    integer :: order(size(lo, 2)), i, j, n
    call sort_order(lo(1, :), order)
    allocate (found(2, 2*size(order)))
    n = 0
    do i = 1, size(order)
      do j = i, size(order)
        if (lo(1, order(j)) > hi(1, order(i))) exit
        if (any(lo(:, order(j)) > hi(:, order(i)) .or. hi(:, order(j)) < lo(:, order(i)))) cycle
        if (n == size(found, 2)) then
          allocate (more(2, 2*n))
          more(:, 1:n) = found
          call move_alloc(more, found)
        end if
        n = n + 1
        found(:, n) = [min(order(i), order(j)), max(order(i), order(j))]
      end do
    end do
    couple = found(:, 1:n)
  end subroutine overlapping_boxes
end module dotyk_contact_broad_phase
