!> What the search for contact pairs found, for the log.
module dotyk_contact_pair_report
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: text_t
  implicit none
  private

  type, public :: group_report_t  !! The pairs of one `&contact` that is searched.
    integer :: line = 0  !! Line of the group.
    character(:), allocatable :: name  !! Its name; may be empty.
    logical :: auto = .false.  !! Whether it has `auto`.
    integer :: n_pairs = 0  !! Number of pairs.
    integer :: n_named = 0  !! Number of pairs of bodies that another `&contact` names and that were left to it.
    integer :: n_excluded = 0  !! Number of pairs of bodies that `exclude` leaves out.
    type(text_t), allocatable :: unused(:)  !! Exclusions that leave out nothing (n_unused).
    real(dp) :: distance = 0  !! Largest search distance of these pairs [length].
  end type group_report_t

  type, public :: merged_pair_t  !! Two pairs that are the same contact: the first one was dropped.
    character(:), allocatable :: name  !! Name of the dropped pair.
    integer :: line = 0  !! Its line.
    character(:), allocatable :: kept  !! Name of the pair that remains.
    integer :: kept_line = 0  !! Its line.
  end type merged_pair_t

  type, public :: unnamed_faces_t  !! Faces of two bodies that are near each other and in no pair.
    integer :: body_a = 0  !! Index of the first body.
    integer :: body_b = 0  !! Index of the second body.
    integer :: n_facets = 0  !! Number of facets of the first body.
    real(dp) :: distance = 0  !! Smallest distance; negative where they overlap [length].
    real(dp) :: position(3) = 0  !! Centre of the facet with this distance (3) [length].
    logical :: in_pair = .false.  !! Whether other faces of the two bodies are in a pair.
  end type unnamed_faces_t

  type, public :: distant_body_t  !! A body in no pair, and the body that is nearest beyond the search distance.
    integer :: body = 0  !! Index of the body.
    integer :: other = 0  !! Index of the other body.
    real(dp) :: distance = 0  !! Distance of their faces [length].
    real(dp) :: searched = 0  !! The search distance of the two [length].
  end type distant_body_t

  type, public :: pair_report_t  !! All that was found.
    type(group_report_t), allocatable :: group(:)  !! Groups that are searched, in the order of the file (n_groups).
    type(merged_pair_t), allocatable :: merged(:)  !! Pairs that were dropped (n_merged).
    type(unnamed_faces_t), allocatable :: unnamed(:)  !! Faces in no pair (n_unnamed).
    !> Bodies in no pair that others come near, beyond the search distance of `auto` (n_distant).
    type(distant_body_t), allocatable :: distant(:)
    !> Pairs that were found and have no constraint: their surfaces nowhere lie opposite each other.
    integer :: n_empty = 0
  end type pair_report_t
end module dotyk_contact_pair_report
