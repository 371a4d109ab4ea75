!> An orthonormal basis of the rigid motions that the supports of a body leave free, as displacements of its nodes.
!>
!> The basis is kept as translations and rotations beside the displacements: these are evaluated from those and from nothing else,
!> so that they are rigid to round-off however thin the body is.
module dotyk_elasticity_rigid_body_modes
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_3d
  use dotyk_base_text, only: text_t
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_rigid_motion, only: describe_rigid_motions, rigid_null_space, component_text, rigid_displacement
  use dotyk_linalg_dense, only: orthonormal_range
  use dotyk_mesh_body_mesh, only: body_mesh_t, connected_components
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private

  !> Free rigid motions of all connected parts of a body.
  type, public :: rigid_body_modes_t
    !> Number of motions.
    integer :: n = 0
    !> One of dotyk_elasticity_analysis' constants.
    integer, private :: analysis = analysis_3d
    !> The part that each motion moves (n).
    integer, allocatable, private :: part(:)
    !> Translation, and rotation times the part's radius, about the part's centre (6, n).
    real(dp), allocatable, private :: coefficient(:, :)
    !> Centre (3, n_parts) and radius (n_parts) of each part [length].
    real(dp), allocatable, private :: centre(:, :), radius(:)
    !> What comes before the motions of each part (n_parts).
    type(text_t), allocatable, private :: part_name(:)
  contains
    procedure :: init => rigid_body_modes_init
    procedure :: move => rigid_body_modes_move
    procedure :: combination_text => rigid_body_modes_combination_text
    procedure :: span_text => rigid_body_modes_span_text
  end type rigid_body_modes_t

  !> Parts whose share of a motion is less than this are not named.
  real(dp), parameter :: least_share = 1.0e-9_dp

contains

  !> Find the motions.
  subroutine rigid_body_modes_init(self, mesh, analysis, constraint, field)
    class(rigid_body_modes_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    type(constraint_t), intent(in) :: constraint
    !> Displacements of the nodes in global axes, orthonormal in the sum over nodes and components, exactly zero along held
    !> unknowns (dim, n_nodes, n).
    real(dp), allocatable, intent(out) :: field(:, :, :)
    integer, allocatable :: part(:)
    real(dp), allocatable :: free(:, :, :)
    integer, allocatable :: n_of_part(:)
    integer :: p, n_parts, first
    allocate (part(mesh%n_nodes()))
    call connected_components(mesh, part, n_parts)
    self%analysis = analysis
    allocate (self%centre(3, n_parts), self%radius(n_parts), self%part_name(n_parts), free(6, 6, n_parts), n_of_part(n_parts))
    do p = 1, n_parts
      call rigid_null_space(mesh, analysis, constraint, part, p, self%centre(:, p), self%radius(p), free(:, :, p), n_of_part(p))
      ! See dotyk_base_text.
      !$omp critical (message)
      self%part_name(p)%s = component_text(mesh, part, p, n_parts)
      !$omp end critical (message)
    end do
    self%n = sum(n_of_part)
    allocate (self%part(self%n), self%coefficient(6, self%n), field(mesh%dimension, mesh%n_nodes(), self%n))
    first = 1
    do p = 1, n_parts
      associate (last => first + n_of_part(p) - 1)
        self%part(first:last) = p
        self%coefficient(:, first:last) = free(:, :n_of_part(p), p)
        call make_orthonormal(mesh%x, constraint, part, p, self%centre(:, p), self%radius(p), &
          self%coefficient(:, first:last), field(:, :, first:last))
        first = last + 1
      end associate
    end do
  end subroutine rigid_body_modes_init

  !> The motions of the same body at another place.
  subroutine rigid_body_modes_move(self, mesh, placement)
    class(rigid_body_modes_t), intent(inout) :: self
    !> The body there.
    type(body_mesh_t), intent(in) :: mesh
    !> How it came there.
    type(placement_t), intent(in) :: placement
    integer, allocatable :: part(:)
    integer :: p, n_parts, k
    do k = 1, self%n
      self%coefficient(1:3, k) = matmul(placement%rotation, self%coefficient(1:3, k))
      self%coefficient(4:6, k) = matmul(placement%rotation, self%coefficient(4:6, k))
    end do
    call placement%apply(self%centre)
    if (size(self%radius) == 1) return
    allocate (part(mesh%n_nodes()))
    call connected_components(mesh, part, n_parts)
    do p = 1, n_parts
      !$omp critical (message)
      self%part_name(p)%s = component_text(mesh, part, p, n_parts)
      !$omp end critical (message)
    end do
  end subroutine rigid_body_modes_move

  !> Make the motions of a part orthonormal by Gram-Schmidt, done on the coefficients.
  subroutine make_orthonormal(x, constraint, part, p, centre, radius, coefficient, field)
    !> Coordinates (dim, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    type(constraint_t), intent(in) :: constraint
    !> Part of each node (n_nodes), and the part that is meant.
    integer, intent(in) :: part(:), p
    real(dp), intent(in) :: centre(3), radius
    !> Independent motions in, orthonormal ones out (6, n).
    real(dp), intent(inout) :: coefficient(:, :)
    !> Their displacements (dim, n_nodes, n).
    real(dp), intent(out) :: field(:, :, :)
    integer :: j, k, pass
    do j = 1, size(coefficient, 2)
      ! The second pass takes off what scaling up a short rest has brought back, the third is sure to find nothing.
      do pass = 1, 3
        call evaluate(x, constraint, part, p, centre, radius, coefficient(:, j), field(:, :, j))
        do k = 1, j - 1
          coefficient(:, j) = coefficient(:, j) - sum(field(:, :, k)*field(:, :, j))*coefficient(:, k)
        end do
        call evaluate(x, constraint, part, p, centre, radius, coefficient(:, j), field(:, :, j))
        coefficient(:, j) = coefficient(:, j)/sqrt(sum(field(:, :, j)**2))
      end do
      call evaluate(x, constraint, part, p, centre, radius, coefficient(:, j), field(:, :, j))
    end do
  end subroutine make_orthonormal

  !> Displacements of the nodes of a part in one motion; the other nodes rest.
  pure subroutine evaluate(x, constraint, part, p, centre, radius, coefficient, field)
    !> As in `make_orthonormal`.
    real(dp), intent(in) :: x(:, :)
    type(constraint_t), intent(in) :: constraint
    integer, intent(in) :: part(:), p
    real(dp), intent(in) :: centre(3), radius
    !> The motion (6).
    real(dp), intent(in) :: coefficient(:)
    !> Displacements (dim, n_nodes).
    real(dp), intent(out) :: field(:, :)
    real(dp) :: u(size(x, 1))
    integer :: i
    do i = 1, size(x, 2)
      u = 0
      if (part(i) == p) u = rigid_displacement(coefficient, centre, radius, x(:, i))
      if (any(constraint%equation(:, i) == 0)) then
        ! Round-off only, but forces of supports are large.
        if (constraint%frame_of(i) > 0) u = matmul(u, constraint%frame(:, :, constraint%frame_of(i)))
        where (constraint%equation(:, i) == 0) u = 0
        if (constraint%frame_of(i) > 0) u = matmul(constraint%frame(:, :, constraint%frame_of(i)), u)
      end if
      field(:, i) = u
    end do
  end subroutine evaluate

  !> A combination of the motions in words, such as "translation along (0, 0, 1)"; empty for none.
  function rigid_body_modes_combination_text(self, amplitude) result(text)
    class(rigid_body_modes_t), intent(in) :: self
    !> Amplitude of each motion (n), any unit.
    real(dp), intent(in) :: amplitude(:)
    character(:), allocatable :: text
    character(:), allocatable :: motion
    real(dp) :: combined(6, 1), most
    integer :: p, k
    text = ''
    most = least_share*maxval([0.0_dp, abs(amplitude)])
    do p = 1, size(self%radius)
      combined = 0
      do k = 1, self%n
        if (self%part(k) /= p .or. .not. abs(amplitude(k)) > most) cycle
        combined(:, 1) = combined(:, 1) + amplitude(k)*self%coefficient(:, k)
      end do
      if (.not. maxval(abs(combined)) > 0) cycle
      combined = combined/maxval(abs(combined))
      call describe_rigid_motions(self%analysis, combined, self%centre(:, p), self%radius(p), motion)
      if (len(text) > 0) text = text//'; '
      text = text//self%part_name(p)%s//motion
    end do
  end function rigid_body_modes_combination_text

  !> All combinations of some combinations of the motions in words, such as "translation along (1, 0, 0) and translation along
  !> (0, 1, 0)"; empty for none.
  function rigid_body_modes_span_text(self, amplitude) result(text)
    class(rigid_body_modes_t), intent(in) :: self
    !> Amplitudes of each combination as columns (n, number of them), any unit. Columns that are small beside the others count as none.
    real(dp), intent(in) :: amplitude(:, :)
    character(:), allocatable :: text
    character(:), allocatable :: motion
    real(dp) :: combined(6, size(amplitude, 2)), basis(6, 6)
    integer :: p, k, j, n
    real(dp), parameter :: small = 1.0e-6_dp
    text = ''
    do p = 1, size(self%radius)
      combined = 0
      do j = 1, size(amplitude, 2)
        do k = 1, self%n
          if (self%part(k) == p) combined(:, j) = combined(:, j) + amplitude(k, j)*self%coefficient(:, k)
        end do
      end do
      where (abs(combined) <= small*maxval(abs(combined))) combined = 0
      call orthonormal_range(combined, small, basis, n)
      if (n == 0) cycle
      call describe_rigid_motions(self%analysis, basis(:, :n), self%centre(:, p), self%radius(p), motion)
      if (len(text) > 0) text = text//'; '
      text = text//self%part_name(p)%s//motion
    end do
  end function rigid_body_modes_span_text
end module dotyk_elasticity_rigid_body_modes
