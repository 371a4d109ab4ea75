!> All that is known of a contact problem before it is solved, but for the QP: bodies, their modes and factorizations,
!> contact pairs.
module dotyk_control_contact_problem
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_thresholds, only: pi
  use dotyk_contact_operator, only: build_operator, contact_operator_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_contact_pair_report, only: pair_report_t
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use dotyk_scheme_coarse_space, only: slide_t
  implicit none
  private
  public :: build_rows, first_mode, mesh_compliance, congruent_groups

  type, public :: congruent_group_t  !! One group.
    integer :: representative = 0  !! The representative of the class.
    !> Bodies of the class (n). Those of other ranks keep their places, so that the digits of the others do not depend
    !> on them.
    integer, allocatable :: body(:)
  end type congruent_group_t

  !> Congruent bodies in one pass at most: the work that depends on the mesh alone is small beside that for so many, and
  !> the memory is small beside a factor.
  integer, parameter, public :: most_bodies = 16

  type, public :: isolated_body_t  !! Displacements of a body that touches no other.
    !> (dimension, n_nodes) [length]; not allocated where it touches another.
    real(dp), allocatable :: displacement(:, :)
  end type isolated_body_t

  type, public :: tied_surfaces_t  !! Surfaces of two bodies that are tied together.
    character(:), allocatable :: name  !! Name of the tie.
    type(contact_pair_t), allocatable :: component(:)  !! Rows of each component of the displacements (dimension).
    type(surface_t) :: surface_a, surface_b  !! Slave and master surface.
    real(dp) :: tied = 0  !! Fraction of the slave surface that is tied [].
    !> Greatest distance between the surfaces, and mean size of the facets of the finer one [length].
    real(dp) :: distance = 0, facet_size = 0
    !> Where a tie rotates its master side: the point x of that lies on `turn*x + offset` of the slave side (3)
    !> [length].
    real(dp) :: offset(3) = 0
    real(dp) :: angle = 0  !! Angle of the rotation; 0 without one [degrees].
    !> Of a rotation: radius, height and angle around the axis of the nodes of the slave side (3, n) [length, length,
    !> degrees].
    real(dp), allocatable :: around_axis(:, :)
    !> Whether it is a bolt, and whether one of given tension, which slides along the normal of its cut.
    logical :: is_bolt = .false., slides = .false.
    real(dp) :: normal(3) = 0  !! Normal of a flat slave surface, out of its body (3) [].
    !> Angle between the normal of a bolt and its shank; 0 where the body is no shank [degrees].
    real(dp) :: oblique = 0
    real(dp) :: force = 0  !! Tension of a bolt that slides [force].
    !> How far its halves overlap: given, or of the last load case in which it was tightened [length].
    real(dp) :: shortening = 0
    !> Whether nothing determines the shortening of a bolt that slides: a half of it is free along the normal.
    logical :: is_free = .false.
  contains
    procedure :: lock => tie_lock
  end type tied_surfaces_t

  type, public :: contact_problem_t  !! The problem.
    type(body_t), allocatable :: body(:)  !! Assembled (n_bodies).
    type(congruence_classes_t) :: classes  !! Which bodies are congruent.
    type(body_ranks_t) :: ranks  !! Which rank computes which bodies.
    type(body_modes_t), allocatable :: modes(:)  !! Modes that the schemes solve for (n_bodies).
    !> What the factorizations of the representatives found out (n_bodies).
    type(factorization_report_t), allocatable :: report(:)
    type(contact_pair_t), allocatable :: pair(:)  !! Contact rows by pairs (n_pairs).
    type(surface_t), allocatable :: surface_a(:)  !! Slave surfaces of the pairs (n_pairs).
    type(surface_t), allocatable :: surface_b(:)  !! Master surfaces of the pairs (n_pairs).
    !> Tied surfaces; their rows follow those of the pairs, tie by tie, component by component (n_ties).
    type(tied_surfaces_t), allocatable :: tie(:)
    type(pair_report_t) :: found  !! What the search for contact pairs found.
    type(isolated_body_t), allocatable :: isolated(:)  !! Bodies that touch no other (n_bodies).
    integer :: n_blas = 1  !! BLAS threads of each solve.
  contains
    procedure :: n_ties => problem_n_ties
    procedure :: are_tied => problem_are_tied
    procedure :: slides => problem_slides
  end type contact_problem_t

contains

  !> Lock a bolt with its shortening, or let it slide.
  subroutine tie_lock(self, is_locked)
    class(tied_surfaces_t), intent(inout) :: self
    logical, intent(in) :: is_locked  !! Whether it is locked.
    integer :: c
    self%slides = .not. is_locked
    do c = 1, size(self%component)
      self%component(c)%row_gap = merge(self%normal(c)*self%shortening, 0.0_dp, is_locked)
    end do
  end subroutine tie_lock

  !> Number of ties.
  pure integer function problem_n_ties(self) result(n)
    class(contact_problem_t), intent(in) :: self
    n = 0
    if (allocated(self%tie)) n = size(self%tie)
  end function problem_n_ties

  !> Whether two bodies are tied to each other.
  pure logical function problem_are_tied(self, a, b) result(are_tied)
    class(contact_problem_t), intent(in) :: self
    integer, intent(in) :: a  !! Index of a body.
    integer, intent(in) :: b  !! Index of the other body.
    integer :: k
    are_tied = .false.
    do k = 1, self%n_ties()
      associate (pair => self%tie(k)%component(1))
        if (all([pair%body_a, pair%body_b] == [a, b]) .or. all([pair%body_b, pair%body_a] == [a, b])) are_tied = .true.
      end associate
    end do
  end function problem_are_tied

  !> Bolts of given tension (n_slides).
  function problem_slides(self) result(slide)
    class(contact_problem_t), intent(in) :: self
    type(slide_t), allocatable :: slide(:)
    integer :: k, first
    allocate (slide(0))
    first = sum(self%pair%n_rows) + 1
    do k = 1, self%n_ties()
      associate (tie => self%tie(k), n => self%tie(k)%component(1)%n_rows, d => size(self%tie(k)%component))
        if (tie%slides) slide = [slide, slide_t(tie%component(1)%body_a, first, n, d, tie%normal, tie%force)]
        first = first + d*n
      end associate
    end do
  end function problem_slides

  !> The operator of contact pairs and ties.
  subroutine build_rows(problem, dimension, operator, divided)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, pairs and ties.
    integer, intent(in) :: dimension  !! Dimension of space.
    !> Rows of the pairs, and those of the ties after them, each component as a pair.
    type(contact_operator_t), intent(out) :: operator
    logical, intent(in) :: divided  !! Whether ranks divide the rows.
    type(contact_pair_t), allocatable :: rows(:)
    type(surface_t), allocatable :: side_a(:), side_b(:)
    integer :: c, k, n
    associate (n_pairs => size(problem%pair), tie => problem%tie)
      if (problem%n_ties() == 0) then
        call build_operator(dimension, size(problem%body), problem%pair, problem%surface_a, problem%surface_b, &
                            operator, divided)
        return
      end if
      n = n_pairs + dimension*size(tie)
      allocate (rows(n), side_a(n), side_b(n))
      do k = 1, n_pairs
        rows(k) = problem%pair(k)
        side_a(k) = problem%surface_a(k)
        side_b(k) = problem%surface_b(k)
      end do
      n = n_pairs
      do k = 1, size(tie)
        do c = 1, dimension
          n = n + 1
          rows(n) = tie(k)%component(c)
          side_a(n) = tie(k)%surface_a
          side_b(n) = tie(k)%surface_b
        end do
      end do
      call build_operator(dimension, size(problem%body), rows, side_a, side_b, operator, divided)
    end associate
  end subroutine build_rows

  !> Index of the first mode of each body among all modes, and one more (n_bodies + 1).
  pure function first_mode(modes, tie) result(first)
    type(body_modes_t), intent(in) :: modes(:)  !! Modes of the bodies (n_bodies).
    !> Ties; the shortenings of bolts that slide come after the modes of their slave bodies; none if absent (n_ties).
    type(tied_surfaces_t), intent(in), optional :: tie(:)
    integer :: first(size(modes) + 1)
    integer :: b, k
    first(1) = 1
    do b = 1, size(modes)
      first(b + 1) = first(b) + modes(b)%n
      if (.not. present(tie)) cycle
      do k = 1, size(tie)
        if (tie(k)%slides .and. tie(k)%component(1)%body_a == b) first(b + 1) = first(b + 1) + 1
      end do
    end do
  end function first_mode

  !> h/E_a + h/E_b of a pair, h the mean size of the slave facets that carry its points: the compliance of the elements
  !> at the contact [length/pressure].
  real(dp) function mesh_compliance(body_a, body_b, pair)
    type(body_t), intent(in) :: body_a  !! Body of the slave side.
    type(body_t), intent(in) :: body_b  !! Body of the master side.
    type(contact_pair_t), intent(in) :: pair  !! The contact pair.
    real(dp) :: area
    integer :: i, n_facets
    area = sum(pair%weight)
    ! A circumference does not make facets larger. Points lie off the axis, but for point contacts: discs there.
    if (body_a%analysis == analysis_axisymmetric) then
      associate (w => pair%weight/pi, r => pair%position(1, :))
        area = sum(w/max(tiny(area), 2*r), mask=r > 0) + sum(sqrt(w), mask=.not. r > 0)
      end associate
    end if
    n_facets = 1
    do i = 2, pair%n_points
      if (pair%facet_a(i) /= pair%facet_a(i - 1)) n_facets = n_facets + 1
    end do
    mesh_compliance = (area/n_facets)**(1.0_dp/(pair%dimension - 1))*(1/body_a%young() + 1/body_b%young())
  end function mesh_compliance

  !> The groups with bodies of this rank, class after class.
  subroutine congruent_groups(problem, group)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, classes and ranks.
    type(congruent_group_t), allocatable, intent(out) :: group(:)  !! (n_groups)
    type(congruent_group_t) :: found(size(problem%body))
    integer, allocatable :: alike(:)
    integer :: b, c, n
    n = 0
    do b = 1, size(problem%body)
      if (.not. problem%classes%is_representative(b)) cycle
      alike = pack([(c, c=1, size(problem%body))], problem%classes%first == b)
      do c = 1, size(alike), most_bodies
        associate (some => alike(c:min(c + most_bodies - 1, size(alike))))
          if (.not. any(problem%ranks%is_own(some))) cycle
          n = n + 1
          found(n)%representative = b
          found(n)%body = some
        end associate
      end do
    end do
    allocate (group, source=found(:n))
  end subroutine congruent_groups
end module dotyk_control_contact_problem
