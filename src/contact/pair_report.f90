!> What the search for contact pairs found, for the log.
module dotyk_contact_pair_report
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: text_t
  implicit none
  private

  !> The pairs of one `&contact` that is searched.
  type, public :: group_report_t
    !> Line of the group.
    integer :: line = 0
    !> Its name; may be empty.
    character(:), allocatable :: name
    !> Whether it has `auto`.
    logical :: auto = .false.
    !> Number of pairs.
    integer :: n_pairs = 0
    !> Number of pairs of bodies that another `&contact` names and that were left to it.
    integer :: n_named = 0
    !> Number of pairs of bodies that `exclude` leaves out.
    integer :: n_excluded = 0
    !> Exclusions that leave out nothing (n_unused).
    type(text_t), allocatable :: unused(:)
    !> Largest search distance of these pairs [length].
    real(dp) :: distance = 0
  end type group_report_t

  !> Two pairs that are the same contact: the first one was dropped.
  type, public :: merged_pair_t
    !> Name of the dropped pair.
    character(:), allocatable :: name
    !> Its line.
    integer :: line = 0
    !> Name of the pair that remains.
    character(:), allocatable :: kept
    !> Its line.
    integer :: kept_line = 0
  end type merged_pair_t

  !> Faces of two bodies that are near each other and in no pair.
  type, public :: unnamed_faces_t
    !> Index of the first body.
    integer :: body_a = 0
    !> Index of the second body.
    integer :: body_b = 0
    !> Number of facets of the first body.
    integer :: n_facets = 0
    !> Smallest distance; negative where they overlap [length].
    real(dp) :: distance = 0
    !> Centre of the facet with this distance (3) [length].
    real(dp) :: position(3) = 0
    !> Whether other faces of the two bodies are in a pair.
    logical :: in_pair = .false.
  end type unnamed_faces_t

  !> A body in no pair, and the body that is nearest beyond the search distance.
  type, public :: distant_body_t
    !> Index of the body.
    integer :: body = 0
    !> Index of the other body.
    integer :: other = 0
    !> Distance of their faces [length].
    real(dp) :: distance = 0
    !> The search distance of the two [length].
    real(dp) :: searched = 0
  end type distant_body_t

  !> All that was found.
  type, public :: pair_report_t
    !> Groups that are searched, in the order of the file (n_groups).
    type(group_report_t), allocatable :: group(:)
    !> Pairs that were dropped (n_merged).
    type(merged_pair_t), allocatable :: merged(:)
    !> Faces in no pair (n_unnamed).
    type(unnamed_faces_t), allocatable :: unnamed(:)
    !> Bodies in no pair that others come near, beyond the search distance of `auto` (n_distant).
    type(distant_body_t), allocatable :: distant(:)
    !> Pairs that were found and have no constraint: their surfaces nowhere lie opposite each other.
    integer :: n_empty = 0
  end type pair_report_t
end module dotyk_contact_pair_report
