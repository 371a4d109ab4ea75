!> Names that keywords may take: each enumeration is a list of names and the named integers that are their places in it.
module dotyk_input_names
  use dotyk_base_text, only: lower, text_t
  implicit none
  private

  !> What kind of problem `&scene analysis` asks for.
  character(*), parameter, public :: analysis_names = '3d plane_strain plane_stress axisymmetric'
  integer, parameter, public :: analysis_3d = 1            !< three-dimensional
  integer, parameter, public :: analysis_plane_strain = 2  !< no strain across the plane
  integer, parameter, public :: analysis_plane_stress = 3  !< no stress across the plane
  integer, parameter, public :: analysis_axisymmetric = 4  !< about y, x is the radius

  !> How a material was described; not a keyword, it follows from the keys that are given.
  character(*), parameter, public :: material_kind_names = 'isotropic orthotropic anisotropic'
  integer, parameter, public :: material_isotropic = 1    !< one young, one poisson
  integer, parameter, public :: material_orthotropic = 2  !< three each of young, poisson and shear, and two axes
  integer, parameter, public :: material_anisotropic = 3  !< 21 stiffnesses

  !> What a `&load` gives; these are the keys of the group, each with its `_formula`.
  character(*), parameter, public :: load_kind_names = 'traction pressure local_traction force_density'
  integer, parameter, public :: load_traction = 1        !< force per area, global axes
  integer, parameter, public :: load_pressure = 2        !< force per area along the inward normal
  integer, parameter, public :: load_local_traction = 3  !< force per area in the axes of the surface
  integer, parameter, public :: load_force_density = 4   !< force per volume, global axes

  !> Where the gap of a `&contact` comes from; not a keyword, it follows from the keys that are given.
  character(*), parameter, public :: gap_kind_names = 'geometry constant formula'
  integer, parameter, public :: gap_geometry = 1  !< the signed distance along the normal
  integer, parameter, public :: gap_constant = 2  !< `gap`
  integer, parameter, public :: gap_formula = 3   !< `gap_formula`

  !> How theta was given; these are the keys of `&solver` and `&contact`.
  character(*), parameter, public :: theta_kind_names = 'theta theta_relative theta_mesh'
  integer, parameter, public :: theta_absolute = 1  !< length over pressure
  integer, parameter, public :: theta_relative = 2  !< times size_a/E_a + size_b/E_b
  integer, parameter, public :: theta_mesh = 3      !< times h_a/E_a + h_b/E_b, point by point

  !> `&solver response`; the same numbers in dotyk_response_full.
  character(*), parameter, public :: response_names = 'auto full condensed compliance'
  integer, parameter, public :: response_auto = 1       !< what is cheaper
  integer, parameter, public :: response_full = 2       !< solves with the whole factor
  integer, parameter, public :: response_condensed = 3  !< contact unknowns last, solves with their part of the factor
  integer, parameter, public :: response_compliance = 4 !< the compliance as a matrix

  !> `&solver locking`.
  character(*), parameter, public :: locking_names = 'auto project ignore'
  integer, parameter, public :: locking_auto = 1     !< projected dilatation, and quadratic elements for linear simplices
  integer, parameter, public :: locking_project = 2  !< projected dilatation only
  integer, parameter, public :: locking_ignore = 3   !< nothing

  !> `&solver theta_rule`.
  character(*), parameter, public :: theta_rule_names = 'mesh'

  !> The rows of the contact operator, `&contact points`.
  character(*), parameter, public :: points_names = 'nodes quadrature'
  integer, parameter, public :: points_nodes = 1       !< the vertices of surface_a
  integer, parameter, public :: points_quadrature = 2  !< the quadrature points of surface_a's facets

  !> What gaps and normals are taken from, `&contact geometry`.
  character(*), parameter, public :: geometry_names = 'smooth elements straight'
  integer, parameter, public :: geometry_smooth = 1    !< patches with continuous normals over the facets
  integer, parameter, public :: geometry_elements = 2  !< that of the elements
  integer, parameter, public :: geometry_straight = 3  !< that of the elements' corners

  !> Where the integration points are, `&contact quadrature`.
  character(*), parameter, public :: quadrature_names = 'segments plain'
  integer, parameter, public :: quadrature_segments = 1  !< on the pieces that the facets of surface_b cut out of those of a
  integer, parameter, public :: quadrature_plain = 2     !< on whole facets of surface_a

  !> `&solver scheme`.
  character(*), parameter, public :: scheme_names = 'auto neumann dual robin nesterov anderson secant'
  integer, parameter, public :: scheme_auto = 1     !< the best one for the scene
  integer, parameter, public :: scheme_neumann = 2  !< the parallel Neumann scheme, equations (43) to (46)
  integer, parameter, public :: scheme_dual = 3     !< contact forces as unknowns, by active sets
  integer, parameter, public :: scheme_robin = 4    !< each body on springs towards the others
  integer, parameter, public :: scheme_nesterov = 5 !< neumann with momentum
  integer, parameter, public :: scheme_anderson = 6 !< neumann with combinations of its last steps
  integer, parameter, public :: scheme_secant = 7   !< neumann with crossed secants

  !> `&solver linear_solver`.
  character(*), parameter, public :: linear_solver_names = 'auto direct iterative'
  integer, parameter, public :: linear_solver_auto = 1       !< what is cheaper
  integer, parameter, public :: linear_solver_direct = 2     !< columns of the compliance and a factorization
  integer, parameter, public :: linear_solver_iterative = 3  !< conjugate gradients

  !> `&solver gamma_rule`.
  character(*), parameter, public :: gamma_rule_names = 'spectral theory fixed'
  integer, parameter, public :: gamma_spectral = 1  !< 2/(2+L)
  integer, parameter, public :: gamma_theory = 2    !< 1/(1+L)^2, the paper's
  integer, parameter, public :: gamma_fixed = 3     !< `gamma`

  !> `&solver stop_rule`.
  character(*), parameter, public :: stop_rule_names = 'residual paper increment budget'
  integer, parameter, public :: stop_residual = 1   !< the guaranteed error bound
  integer, parameter, public :: stop_paper = 2      !< the bound (41)
  integer, parameter, public :: stop_increment = 3  !< the relative change of the displacements
  integer, parameter, public :: stop_budget = 4     !< a part of the error of penalty and mesh

  !> `&output fields`.
  character(*), parameter, public :: field_names = 'displacement stress contact error'
  integer, parameter, public :: field_displacement = 1  !< displacement of the nodes
  integer, parameter, public :: field_stress = 2        !< stress of the elements
  integer, parameter, public :: field_contact = 3       !< contact pressure
  integer, parameter, public :: field_error = 4         !< discretization error of the elements

  !> `&output error_parts`.
  character(*), parameter, public :: error_part_names = 'penalty discretization'
  integer, parameter, public :: error_part_penalty = 1         !< distance to the solution without penalty
  integer, parameter, public :: error_part_discretization = 2  !< error of the mesh

  public :: name_at, place_of_name, split_words

contains

  !> The name at a place of a list; empty where the list has no such place.
  pure function name_at(names, place) result(name)
    !> One of the lists of names above.
    character(*), intent(in) :: names
    !> Place in it, from 1.
    integer, intent(in) :: place
    character(:), allocatable :: name
    type(text_t), allocatable :: words(:)
    call split_words(names, words)
    name = ''
    if (place >= 1 .and. place <= size(words)) name = words(place)%s
  end function name_at

  !> The place of a name in a list, whatever its case; 0 where it is not there.
  pure integer function place_of_name(names, name) result(place)
    !> One of the lists of names above.
    character(*), intent(in) :: names
    !> The name to look for.
    character(*), intent(in) :: name
    type(text_t), allocatable :: words(:)
    integer :: i
    call split_words(names, words)
    place = 0
    do i = 1, size(words)
      if (words(i)%s == lower(name) .and. len(words(i)%s) == len(name)) place = i
    end do
  end function place_of_name

  !> The words of a text that blanks separate.
  pure subroutine split_words(text, words)
    !> Words separated by blanks.
    character(*), intent(in) :: text
    !> Its words, none where the text is blank.
    type(text_t), allocatable, intent(out) :: words(:)
    integer :: i, n, first
    n = 0
    do i = 1, len(text)
      if (starts_word(text, i)) n = n + 1
    end do
    allocate (words(n))
    n = 0
    first = 1
    do i = 1, len(text)
      if (starts_word(text, i)) first = i
      if (text(i:i) == ' ') cycle
      if (i < len(text)) then
        if (text(i + 1:i + 1) /= ' ') cycle
      end if
      n = n + 1
      words(n)%s = text(first:i)
    end do
  end subroutine split_words

  !> Does a word start at this place?
  pure logical function starts_word(text, i) result(starts)
    character(*), intent(in) :: text
    integer, intent(in) :: i
    starts = text(i:i) /= ' '
    if (starts .and. i > 1) starts = text(i - 1:i - 1) == ' '
  end function starts_word
end module dotyk_input_names
