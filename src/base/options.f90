!> The enumerations of the program, each with its names and its default: values of namelist keys that all layers use.
!>
!> An enumeration consists of named integers 1, 2, ... and one list of names, separated by blanks, in the same order.
!> Enumerations that follow from the presence of keys (of materials, loads, gaps, theta) have names as well.
module dotyk_base_options
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: join, lower, split_words, suggestion, text_t
  implicit none
  private

  !> `&scene analysis`: dimension and kinematics.
  character(*), parameter, public :: analysis_names = '3d plane_strain plane_stress axisymmetric'
  integer, parameter, public :: analysis_3d = 1            !< three-dimensional
  integer, parameter, public :: analysis_plane_strain = 2  !< strains zz, yz, xz are zero; forces per unit thickness
  integer, parameter, public :: analysis_plane_stress = 3  !< stresses zz, yz, xz are zero; forces per unit thickness
  integer, parameter, public :: analysis_axisymmetric = 4  !< about y, x is the radius; forces are those of 2 pi
  integer, parameter, public :: default_analysis = analysis_3d

  !> Symmetry of a material; follows from the keys of `&material`.
  character(*), parameter, public :: material_names = 'isotropic orthotropic anisotropic'
  integer, parameter, public :: material_isotropic = 1    !< one Young's modulus, one Poisson's ratio
  integer, parameter, public :: material_orthotropic = 2  !< three each of young, poisson and shear, two axes
  integer, parameter, public :: material_anisotropic = 3  !< 21 components of the stiffness

  !> Kinds of loads: keys of `&load`, each with its `_formula`.
  character(*), parameter, public :: load_names = &
                             'traction pressure local_traction force_density angular_velocity acceleration'
  integer, parameter, public :: load_traction = 1        !< force per area, global axes
  integer, parameter, public :: load_pressure = 2        !< force per area along the inward normal
  integer, parameter, public :: load_local_traction = 3  !< force per area along xi, eta, n of the surface
  integer, parameter, public :: load_force_density = 4   !< force per volume, global axes
  integer, parameter, public :: load_angular_velocity = 5  !< centrifugal force of a rotation
  integer, parameter, public :: load_acceleration = 6    !< force per mass, such as gravity, global axes
  integer, parameter, public :: load_total = 7           !< force and moment, spread over a surface; no name of its own

  !> Initial gap of a contact pair; follows from the keys of `&contact`.
  character(*), parameter, public :: gap_names = 'geometry constant formula'
  integer, parameter, public :: gap_geometry = 1  !< distance between the surfaces along the normal
  integer, parameter, public :: gap_constant = 2  !< `gap`
  integer, parameter, public :: gap_formula = 3   !< `gap_formula`, evaluated on surface_a
  integer, parameter, public :: default_gap = gap_geometry

  !> Forms of the penalty parameter: keys of `&solver` and `&contact`.
  character(*), parameter, public :: theta_names = 'theta theta_relative theta_mesh theta_formula'
  integer, parameter, public :: theta_absolute = 1  !< length over pressure
  integer, parameter, public :: theta_relative = 2  !< factor of size_a/E_a + size_b/E_b
  integer, parameter, public :: theta_mesh = 3      !< factor of h_a/E_a + h_b/E_b, point by point
  integer, parameter, public :: theta_formula = 4   !< `theta_formula` of `&contact`, evaluated on surface_a
  integer, parameter, public :: default_theta = theta_mesh

  !> `&contact discretization`: rows of the contact operator.
  character(*), parameter, public :: discretization_names = 'mortar quadrature'
  integer, parameter, public :: discretization_mortar = 1      !< dual mortar: weighted gaps at vertices of surface_a
  integer, parameter, public :: discretization_quadrature = 2  !< gaps at the quadrature points of surface_a
  integer, parameter, public :: default_discretization = discretization_mortar

  !> `&contact geometry`: surfaces that gaps and normals are taken from.
  character(*), parameter, public :: geometry_names = 'smooth elements'
  integer, parameter, public :: geometry_smooth = 1    !< patches with continuous normals over the facets
  integer, parameter, public :: geometry_elements = 2  !< facets of the elements
  integer, parameter, public :: default_geometry = geometry_smooth

  !> `&contact quadrature`: quadrature points of a contact pair.
  character(*), parameter, public :: quadrature_names = 'segments plain'
  integer, parameter, public :: quadrature_segments = 1  !< on mortar segments, overlaps of facets of both surfaces
  integer, parameter, public :: quadrature_plain = 2     !< on whole facets of surface_a
  integer, parameter, public :: default_quadrature = quadrature_segments

  !> `&contact condition`: interface condition of a pair in the Robin scheme.
  character(*), parameter, public :: condition_names = 'robin neumann'
  integer, parameter, public :: condition_robin = 1    !< each body on springs 1/theta
  integer, parameter, public :: condition_neumann = 2  !< each body under the last contact pressure
  integer, parameter, public :: default_condition = condition_robin

  character(*), parameter, public :: scheme_names = 'auto neumann dual robin'  !! `&solver scheme`.
  integer, parameter, public :: scheme_auto = 1     !< dual, unless other keys ask for neumann
  integer, parameter, public :: scheme_neumann = 2  !< parallel Neumann scheme, equations (43) to (46)
  integer, parameter, public :: scheme_dual = 3     !< primal-dual active set on the Lagrange multipliers
  integer, parameter, public :: scheme_robin = 4    !< (32) with Robin conditions, G = A + X
  integer, parameter, public :: default_scheme = scheme_auto

  !> `&solver response`: form of a body's compliance operator.
  character(*), parameter, public :: response_names = 'auto full compliance multigrid'
  integer, parameter, public :: response_auto = 1        !< the cheapest form
  integer, parameter, public :: response_full = 2        !< solves with the whole factor
  integer, parameter, public :: response_compliance = 3  !< dense compliance matrix of the contact unknowns
  integer, parameter, public :: response_multigrid = 4   !< p-multigrid, without a factor of the whole body
  integer, parameter, public :: default_response = response_auto

  !> `&solver linear_solver`: systems of the active set.
  character(*), parameter, public :: linear_solver_names = 'auto direct iterative'
  integer, parameter, public :: linear_solver_auto = 1       !< the cheaper one
  integer, parameter, public :: linear_solver_direct = 2     !< columns of the compliance and a factorization
  integer, parameter, public :: linear_solver_iterative = 3  !< conjugate gradients
  integer, parameter, public :: default_linear_solver = linear_solver_auto

  !> `&solver gamma_rule`: relaxation parameter gamma of (44).
  character(*), parameter, public :: gamma_rule_names = 'spectral theory fixed'
  integer, parameter, public :: gamma_spectral = 1  !< 2/(2+L), the best one
  integer, parameter, public :: gamma_theory = 2    !< 1/(1+L)^2, the best one of Theorem 4 in the energy norm
  integer, parameter, public :: gamma_fixed = 3     !< `gamma`
  integer, parameter, public :: default_gamma_rule = gamma_spectral

  !> `&solver stop_rule`: quantity that ends the iteration.
  character(*), parameter, public :: stop_rule_names = 'residual paper increment'
  integer, parameter, public :: stop_residual = 1   !< guaranteed error bound below the tolerance
  integer, parameter, public :: stop_paper = 2      !< bound (41) below the tolerance; Neumann scheme only
  integer, parameter, public :: stop_increment = 3  !< relative change of the displacements below the tolerance
  integer, parameter, public :: default_stop_rule = stop_residual

  character(*), parameter, public :: locking_names = 'auto ignore'  !! `&solver locking`: nearly incompressible bodies.
  integer, parameter, public :: locking_auto = 1    !< projected dilatation, and order elevation of linear simplices
  integer, parameter, public :: locking_ignore = 2  !< elements as they are
  integer, parameter, public :: default_locking = locking_auto

  !> `&output fields`.
  character(*), parameter, public :: field_names = 'displacement stress contact error reaction nodal_stress'
  integer, parameter, public :: field_displacement = 1  !< displacement of the nodes
  integer, parameter, public :: field_stress = 2        !< stress of the elements
  integer, parameter, public :: field_contact = 3       !< contact pressure
  integer, parameter, public :: field_error = 4         !< discretization error of the elements
  integer, parameter, public :: field_reaction = 5      !< reactions of supports at their nodes
  integer, parameter, public :: field_nodal_stress = 6  !< stresses at the nodes
  integer, parameter, public :: n_fields = 6

  character(*), parameter, public :: error_part_names = 'penalty discretization'  !! `&output error_parts`.
  integer, parameter, public :: error_part_penalty = 1         !< distance to the solution with theta = 0
  integer, parameter, public :: error_part_discretization = 2  !< discretization error

  character(*), parameter, public :: aim_names = 'energy contact'  !! `&accuracy aim`.
  integer, parameter, public :: aim_energy = 1   !< the error in the energy norm
  integer, parameter, public :: aim_contact = 2  !< the same, errors far from the contact count less

  !> Kinds of `quantity`. The first ones are linear in displacements and contact forces.
  character(*), parameter, public :: quantity_names = 'force displacement reaction mean_pressure peak area mises'
  integer, parameter, public :: quantity_force = 1         !< contact force of a pair
  integer, parameter, public :: quantity_displacement = 2  !< mean displacement of a face along an axis
  integer, parameter, public :: quantity_reaction = 3      !< reaction of a support along an axis
  integer, parameter, public :: last_linear_quantity = quantity_reaction
  integer, parameter, public :: quantity_mean_pressure = 4  !< normal force of a pair over its contact area
  integer, parameter, public :: quantity_peak = 5           !< greatest contact pressure of a pair
  integer, parameter, public :: quantity_area = 6           !< contact area of a pair
  integer, parameter, public :: quantity_mises = 7          !< greatest von Mises stress at the nodes of a body or face
  !> Greatest displacement of the nodes of a body or face: a displacement without an axis.
  integer, parameter, public :: quantity_travel = 8

  real(dp), parameter, public :: default_tolerance = 1.0e-6_dp  !! Default of `&solver tolerance` [].
  real(dp), parameter, public :: default_max_unbalanced = 0.01_dp  !! Default of `&solver max_unbalanced` [].
  integer, parameter, public :: default_max_iterations = 100000  !! Default of `&solver max_iterations`.

  public :: find_option, option_name, quantity_of_pair

contains

  !> Whether a kind of quantity belongs to a contact pair, the others to a body.
  pure logical function quantity_of_pair(kind)
    integer, intent(in) :: kind  !! One of `quantity_*`.
    quantity_of_pair = any(kind == [quantity_force, quantity_mean_pressure, quantity_peak, quantity_area])
  end function quantity_of_pair

  !> Name of an option; empty where the list has no such option.
  pure function option_name(names, option) result(name)
    character(*), intent(in) :: names  !! One of the lists above.
    integer, intent(in) :: option  !! Option, from 1.
    character(:), allocatable :: name
    type(text_t), allocatable :: words(:)
    call split_words(names, words)
    name = ''
    if (option >= 1 .and. option <= size(words)) name = words(option)%s
  end function option_name

  !> Option of a name, in upper or lower case.
  pure subroutine find_option(names, name, option, message)
    character(*), intent(in) :: names  !! One of the lists above.
    character(*), intent(in) :: name  !! Name to look up, without blanks around it.
    integer, intent(out) :: option  !! Its option; 0 where the list has no such name.
    character(:), allocatable, intent(out), optional :: message  !! "must be one of: ...", with the nearest; or empty.
    type(text_t), allocatable :: words(:)
    call split_words(names, words)
    do option = 1, size(words)
      if (words(option)%s == lower(name) .and. len(words(option)%s) == len(name)) exit
    end do
    if (option > size(words)) option = 0
    if (.not. present(message)) return
    message = ''
    if (option == 0) message = 'must be one of: '//join(words, ', ')//suggestion(name, words)
  end subroutine find_option
end module dotyk_base_options
