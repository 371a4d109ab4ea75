!> Sizes of elements on one volume of a geometry (in the plane, on one surface), given on its last mesh: what gmsh
!> meshes the geometry anew by.
!>
!> gmsh reads them as a list-based view, as a background field that is restricted to the volume and its boundary, so
!> that each of two bodies that touch has its own sizes.
module dotyk_mesh_size_view
  use dotyk_base_error, only: error_t, exit_not_written, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_element, only: element_tet4, element_tri3
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: size_view_t  !! The sizes on one volume.
    character(:), allocatable :: file  !! Path of the geometry.
    integer :: entity = 0  !! Volume of the geometry, as gmsh numbers it.
    type(body_mesh_t) :: mesh  !! Corners of its elements, simplices in one block, in the axes of the geometry.
    real(dp), allocatable :: size(:)  !! Size of the elements at the nodes (n_nodes) [length].
  contains
    procedure :: init => view_init
    procedure :: measures => view_measures
    procedure :: spread_to_nodes => view_spread_to_nodes
    procedure :: limit_gradient => view_limit_gradient
    procedure :: expected_elements => view_expected_elements
    procedure :: write => view_write
    procedure :: script => view_script
  end type size_view_t

  public :: size_of_measure

  real(dp), parameter :: gradient = 0.4_dp  !! Growth of the sizes over the distance [].

  !> Measure of a regular simplex of edge 1, in the plane and in space, and what elements of gmsh have of it where this
  !> edge is asked for: measured on meshes of Delaunay and HXT, within 25 %.
  real(dp), parameter :: regular(2:3) = [sqrt(3.0_dp)/4, sqrt(2.0_dp)/12], filled(2:3) = [1/0.9_dp, 1/0.72_dp]
  real(dp), parameter :: skirt = 0.4_dp  !! Thickness of the skirt, as a fraction of the facets.
  integer, parameter :: most_passes = 400  !! Passes along all edges at most.

contains

  !> Elements of a volume.
  subroutine view_init(self, file, entity, dimension, x, corner, tag)
    class(size_view_t), intent(out) :: self
    character(*), intent(in) :: file  !! Path of the geometry.
    integer, intent(in) :: entity  !! The volume.
    integer, intent(in) :: dimension  !! Dimension of space.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body in the axes of the geometry (dimension, n_nodes) [length].
    integer, intent(in) :: corner(:, :)  !! Corners of its elements there (dimension + 1, n_elements).
    integer(int64), intent(in) :: tag(:)  !! Their tags in the mesh file (n_elements).
    integer :: place(size(x, 2))
    integer :: i, k
    self%file = file
    self%entity = entity
    self%mesh%dimension = dimension
    place = 0
    do i = 1, size(corner, 2)
      place(corner(:, i)) = 1
    end do
    self%mesh%x = x(:, pack([(k, k=1, size(place))], place > 0))
    k = 0
    do i = 1, size(place)
      k = k + place(i)
      if (place(i) > 0) place(i) = k
    end do
    allocate (self%mesh%block(1))
    associate (block => self%mesh%block(1))
      block%kind = merge(element_tet4, element_tri3, dimension == 3)
      block%node = reshape(place(reshape(corner, [size(corner)])), shape(corner))
      block%tag = tag
    end associate
  end subroutine view_init

  !> Measures of the elements: volumes, in the plane areas (n_elements) [length**dimension].
  pure function view_measures(self) result(measure)
    class(size_view_t), intent(in) :: self
    real(dp), allocatable :: measure(:)
    real(dp) :: edge(3, 3)
    integer :: e, k
    associate (d => self%mesh%dimension, node => self%mesh%block(1)%node, x => self%mesh%x)
      allocate (measure(size(node, 2)))
      edge = 0
      do e = 1, size(node, 2)
        do k = 1, d
          edge(:d, k) = x(:, node(k + 1, e)) - x(:, node(1, e))
        end do
        if (d == 3) then
          measure(e) = abs(dot_product(cross(edge(:, 1), edge(:, 2)), edge(:, 3)))/6
        else
          measure(e) = norm2(cross(edge(:, 1), edge(:, 2)))/2
        end if
      end do
    end associate
  end function view_measures

  !> Size that gmsh makes elements of a measure by [length].
  elemental real(dp) function size_of_measure(measure, dimension) result(size)
    real(dp), intent(in) :: measure  !! Measure of the element [length**dimension].
    integer, intent(in) :: dimension  !! Dimension of space.
    size = (measure/(regular(dimension)*filled(dimension)))**(1.0_dp/dimension)
  end function size_of_measure

  !> Sizes at nodes: geometric means of those of the elements, weighted by their measures.
  subroutine view_spread_to_nodes(self, of_element)
    class(size_view_t), intent(inout) :: self
    real(dp), intent(in) :: of_element(:)  !! (n_elements) [length]
    real(dp) :: measure(size(of_element)), weight(self%mesh%n_nodes())
    integer :: e
    measure = self%measures()
    weight = 0
    self%size = weight
    associate (node => self%mesh%block(1)%node)
      do e = 1, size(of_element)
        self%size(node(:, e)) = self%size(node(:, e)) + measure(e)*log(of_element(e))
        weight(node(:, e)) = weight(node(:, e)) + measure(e)
      end do
    end associate
    self%size = exp(self%size/weight)
  end subroutine view_spread_to_nodes

  !> Make sizes smaller where they grow too fast along edges.
  subroutine view_limit_gradient(self)
    class(size_view_t), intent(inout) :: self
    real(dp) :: step
    integer :: e, i, j, pass
    logical :: has_changed
    associate (node => self%mesh%block(1)%node, x => self%mesh%x)
      do pass = 1, most_passes
        has_changed = .false.
        do e = 1, size(node, 2)
          do i = 1, size(node, 1)
            do j = 1, size(node, 1)
              associate (from => node(i, e), to => node(j, e))
                step = self%size(from) + gradient*norm2(x(:, to) - x(:, from))
                if (.not. self%size(to) > step*(1 + epsilon(step))) cycle
                self%size(to) = step
                has_changed = .true.
              end associate
            end do
          end do
        end do
        if (.not. has_changed) exit
      end do
    end associate
  end subroutine view_limit_gradient

  !> Number of elements that gmsh will make by the sizes [].
  pure real(dp) function view_expected_elements(self) result(n)
    class(size_view_t), intent(in) :: self
    real(dp), allocatable :: measure(:)
    integer :: e
    measure = self%measures()
    n = 0
    associate (d => self%mesh%dimension, node => self%mesh%block(1)%node)
      do e = 1, size(measure)
        n = n + measure(e)*sum(self%size(node(:, e))**(-d))/size(node, 1)/(regular(d)*filled(d))
      end do
    end associate
  end function view_expected_elements

  !> Write the view, with a skirt of elements outside of the boundary: points of a curved boundary lie beside the facets
  !> of the mesh.
  subroutine view_write(self, path, error)
    class(size_view_t), intent(in) :: self
    character(*), intent(in) :: path  !! Path of the file.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where it cannot be written.
    type(surface_t) :: boundary
    real(dp), allocatable :: outer(:, :), normal(:, :), width(:), x(:, :), h(:)
    integer, allocatable :: times(:)
    real(dp) :: n(3), edge(3, 2)
    integer :: unit, status, e, f, i, j
    integer :: corner(3)
    associate (d => self%mesh%dimension, n_nodes => self%mesh%n_nodes(), node => self%mesh%block(1)%node)
      call extract_boundary(self%mesh, boundary)
      allocate (normal(3, n_nodes), width(n_nodes), source=0.0_dp)
      allocate (times(n_nodes), source=0)
      do f = 1, boundary%n_facets
        corner(:d) = boundary%node(:d, f)
        edge = 0
        do i = 2, d
          edge(:d, i - 1) = self%mesh%x(:, corner(i)) - self%mesh%x(:, corner(1))
        end do
        n = [edge(2, 1), -edge(1, 1), 0.0_dp]
        if (d == 3) n = cross(edge(:, 1), edge(:, 2))
        do i = 1, d
          normal(:, corner(i)) = normal(:, corner(i)) + n/norm2(n)
          width(corner(i)) = width(corner(i)) + norm2(edge(:, 1))
          times(corner(i)) = times(corner(i)) + 1
        end do
      end do
      allocate (outer(3, n_nodes), source=0.0_dp)
      outer(:d, :) = self%mesh%x
      do i = 1, n_nodes
        if (times(i) > 0) outer(:, i) = outer(:, i) + &
          normal(:, i)/max(norm2(normal(:, i)), 0.5_dp*times(i))*skirt*width(i)/times(i)
      end do
      open (newunit=unit, file=path, action='write', status='replace', iostat=status)
      if (status == 0) then
        write (unit, '(a)', iostat=status) 'View "sizes" {'
        allocate (x(3, d + 1), h(d + 1), source=0.0_dp)
        do e = 1, size(node, 2)
          x(:d, :) = self%mesh%x(:, node(:, e))
          h = self%size(node(:, e))
          call write_simplex()
        end do
        do f = 1, boundary%n_facets
          ! The prism over a facet in simplices, those of its neighbours joining them: the corners in one order.
          corner(:d) = sorted(boundary%node(:d, f))
          do j = 1, d
            do i = 1, j
              x(:, i) = 0
              x(:d, i) = self%mesh%x(:, corner(i))
              h(i) = self%size(corner(i))
            end do
            do i = j, d
              x(:, i + 1) = outer(:, corner(i))
              h(i + 1) = self%size(corner(i))
            end do
            call write_simplex()
          end do
        end do
        if (status == 0) write (unit, '(a)', iostat=status) '};'
        close (unit)
      end if
    end associate
    if (status /= 0) call set_error(error, path//': cannot be written', exit_not_written)

  contains

    !> Write one element.
    subroutine write_simplex()
      character(*), parameter :: kind(2:3) = ['ST', 'SS']
      character(500) :: line
      integer :: k
      if (status /= 0) return
      write (line, '(a, *(es16.9, :, ","))') kind(size(h) - 1)//'(', x
      k = len_trim(line)
      write (line(k + 1:), '(a, *(es10.3, :, ","))') '){', h
      write (unit, '(a)', iostat=k) trim(line)//'};'
      if (k /= 0) status = k
    end subroutine write_simplex

    !> Numbers in ascending order.
    pure function sorted(number) result(ordered)
      integer, intent(in) :: number(:)  !! Up to three (n).
      integer :: ordered(size(number))
      integer :: k
      ordered = number
      do k = 1, size(number)
        ordered(k) = minval(number, mask=[(all(number(i) > ordered(:k - 1)), i=1, size(number))])
      end do
    end function sorted
  end subroutine view_write

  !> What gmsh reads after the geometry: the view, restricted to the volume.
  function view_script(self, path, field) result(text)
    class(size_view_t), intent(in) :: self
    character(*), intent(in) :: path  !! Path of the view.
    integer, intent(in) :: field  !! Number of its field; the restricted one has the next.
    character(:), allocatable :: text
    character(:), allocatable :: first, second
    character, parameter :: lf = new_line('a')
    first = 'Field['//to_text(field)//']'
    second = 'Field['//to_text(field + 1)//']'
    text = 'Merge "'//path//'";'//lf// &
      first//' = PostView;'//lf// &
      first//'.ViewIndex = PostProcessing.NbViews - 1;'//lf// &
      second//' = Restrict;'//lf// &
      second//'.InField = '//to_text(field)//';'//lf
    if (self%mesh%dimension == 3) then
      text = text//'faces() = Abs(Boundary{ Volume{'//to_text(self%entity)//'}; });'//lf// &
        second//'.VolumesList = {'//to_text(self%entity)//'};'//lf// &
        'corners() = PointsOf{ Volume{'//to_text(self%entity)//'}; };'//lf
    else
      text = text//'faces() = {'//to_text(self%entity)//'};'//lf// &
        'corners() = PointsOf{ Surface{'//to_text(self%entity)//'}; };'//lf
    end if
    text = text//'edges() = Abs(Boundary{ Surface{faces()}; });'//lf// &
      second//'.SurfacesList = {faces()};'//lf// &
      second//'.CurvesList = {edges()};'//lf// &
      second//'.PointsList = {corners()};'//lf
  end function view_script
end module dotyk_mesh_size_view
