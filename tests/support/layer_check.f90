!> The surface layer of a body in parts against the whole mesh, to the bit.
module layer_check
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: text_t, to_text
  use dotyk_mesh_body_mesh, only: body_mesh_t, connected_components, extract_body
  use dotyk_mesh_body_part, only: body_part_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_boundary_candidates, only: boundary_candidates_t, key_length
  use dotyk_mesh_boundary_part, only: find_entities
  use dotyk_mesh_face_keys, only: key_answers_t
  use dotyk_mesh_layer_share, only: layer_share_t, pack_layer, whole_numbers_t
  use dotyk_mesh_layer_surface, only: extract_layer_surface, find_inner_facets, layer_boundary, layer_surface_names
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_order_elevation, only: elevate_order, has_linear_simplices
  use dotyk_mesh_physical_group, only: group_names
  use dotyk_mesh_surface, only: extract_surface, node_numbers, surface_names, surface_t
  use dotyk_mesh_surface_layer, only: surface_layer_t
  use test_cut_body, only: cut_part, own_elements, split_elements
  use test_directories, only: answers_to
  implicit none
  private
  public :: check_volumes, make_layer, compare_layer

contains

  !> Check all volumes of a mesh in some numbers of parts.
  subroutine check_volumes(mesh, dimension, n_parts, n_surfaces, message)
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    integer, intent(in) :: dimension  !! Dimension of space.
    integer, intent(in) :: n_parts(:)  !! Numbers of parts (any).
    integer, intent(inout) :: n_surfaces  !! Number of surfaces compared so far; added to.
    character(:), allocatable, intent(out) :: message  !! The first difference; empty where there is none.
    type(text_t), allocatable :: names(:)
    type(body_mesh_t) :: whole
    type(surface_layer_t) :: layer
    type(error_t), allocatable :: error
    integer :: i, k, pass
    call group_names(mesh, dimension, names)
    message = ''
    do i = 1, size(names)
      call extract_body(mesh, names(i)%s, dimension, whole, error)
      ! What cannot be extracted cannot be split.
      if (allocated(error)) cycle
      do pass = 1, 2
        if (pass == 2 .and. .not. has_linear_simplices(whole)) exit
        if (pass == 2) call elevate_order(whole)
        do k = 1, size(n_parts)
          call make_layer(mesh, whole, n_parts(k), layer)
          call compare_layer(mesh, whole, layer, n_surfaces, message)
          if (message == '') cycle
          message = names(i)%s//' in '//to_text(n_parts(k))//' parts: '//message
          return
        end do
      end do
    end do
  end subroutine check_volumes

  !> Make the layer of a body in parts, as ranks would.
  subroutine make_layer(mesh, whole, n_parts, layer)
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    type(body_mesh_t), intent(in) :: whole  !! The whole body.
    integer, intent(in) :: n_parts  !! Number of parts.
    type(surface_layer_t), intent(out) :: layer  !! The layer.
    type(body_part_t) :: part
    type(body_mesh_t) :: own(0:n_parts - 1)
    type(whole_numbers_t) :: numbers(0:n_parts - 1)
    type(boundary_candidates_t) :: candidates(0:n_parts - 1)
    type(layer_share_t) :: share
    integer, allocatable :: part_of_element(:), keys(:, :), n_sharers(:)
    integer(int64), allocatable :: inner(:), number(:)
    real(dp), allocatable :: x(:)
    type(key_answers_t) :: answers
    integer :: r
    call split_elements(whole, n_parts, part_of_element)
    allocate (keys(key_length, 0), number(0), x(0))
    allocate (n_sharers(whole%n_nodes()), source=0)
    do r = 0, n_parts - 1
      call cut_part(whole, part_of_element, r, n_parts, part)
      call own_elements(part, own(r), numbers(r))
      n_sharers(numbers(r)%node) = n_sharers(numbers(r)%node) + merge(1, 0, has_element(own(r)))
    end do
    do r = n_parts - 1, 0, -1
      call candidates(r)%find(own(r), numbers(r)%node, n_sharers(numbers(r)%node), r)
      keys = reshape([keys, candidates(r)%key], [key_length, size(keys, 2) + size(candidates(r)%key, 2)])
    end do
    do r = 0, n_parts - 1
      call answers_to(candidates(r)%key, keys, answers)
      call candidates(r)%keep_boundary(own(r), numbers(r)%node, answers)
      call find_inner_facets(mesh, own(r), candidates(r), inner)
      call pack_layer(own(r), numbers(r), candidates(r), inner, whole%diameter(), share)
      ! In any order.
      number = [share%number, number]
      x = [share%x, x]
    end do
    call layer%unpack(whole%file, number, x)
  end subroutine make_layer

  !> Whether elements have each node.
  function has_element(mesh) result(has)
    type(body_mesh_t), intent(in) :: mesh  !! Elements, and their nodes, maybe among others.
    logical :: has(mesh%n_nodes())
    integer :: b, e
    has = .false.
    do b = 1, size(mesh%block)
      do e = 1, size(mesh%block(b)%tag)
        has(mesh%block(b)%node(:, e)) = .true.
      end do
    end do
  end function has_element

  !> Compare a layer with the whole body.
  subroutine compare_layer(mesh, whole, layer, n_surfaces, message)
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    type(body_mesh_t), intent(in) :: whole  !! The whole body.
    type(surface_layer_t), intent(in) :: layer  !! The layer.
    integer, intent(inout) :: n_surfaces  !! Number of surfaces compared so far; added to.
    character(:), allocatable, intent(out) :: message  !! The first difference; empty where there is none.
    type(surface_t) :: a, b
    type(error_t), allocatable :: error_a, error_b
    type(text_t), allocatable :: names(:), layer_names(:)
    integer, allocatable :: number(:), component(:)
    integer :: i, n
    message = ''
    associate (node => layer%whole%node)
      if (.not. all(node(2:) > node(:size(node) - 1))) message = 'order of nodes'
      if (any(abs(layer%mesh%x - whole%x(:, node)) > 0)) message = 'coordinates'
      if (any(layer%mesh%node_tag /= whole%node_tag(node))) message = 'node tags'
      allocate (component(whole%n_nodes()))
      call connected_components(whole, component, n)
      if (n /= layer%n_components .or. any(layer%component /= component(node))) message = 'parts'
      do i = 1, size(whole%block)
        associate (block => layer%mesh%block(i), element => layer%whole%block(i)%element)
          if (block%kind /= whole%block(i)%kind) message = 'kinds'
          if (size(whole%block(i)%tag) /= layer%whole%block(i)%n_elements) message = 'number of elements'
          if (any(block%tag /= whole%block(i)%tag(element))) message = 'element tags'
          if (any(reshape(node(reshape(block%node, [size(block%node)])), shape(block%node)) /= &
                  whole%block(i)%node(:, element))) message = 'nodes of elements'
        end associate
      end do
    end associate
    if (layer%whole%n_nodes /= whole%n_nodes()) message = 'number of nodes'
    if (abs(layer%diameter - whole%diameter()) > 0) message = 'diameter'
    if (layer%mesh%order_elevated .neqv. whole%order_elevated) message = 'order elevation'
    call extract_boundary(whole, a)
    call node_numbers(mesh, whole, number)
    call find_entities(mesh, number, a)
    call layer_boundary(mesh, layer, b)
    call compare(a, b, 'boundary')
    call surface_names(mesh, whole, names)
    call layer_surface_names(mesh, layer, layer_names)
    if (size(names) /= size(layer_names)) then
      message = 'number of surfaces'
      return
    end if
    do i = 1, size(names)
      if (names(i)%s /= layer_names(i)%s) message = 'names'
      call extract_surface(mesh, whole, names(i)%s, a, error_a)
      call extract_layer_surface(mesh, layer, names(i)%s, b, error_b)
      if (allocated(error_a) .neqv. allocated(error_b)) then
        message = 'errors of surface '//names(i)%s
      else if (allocated(error_a)) then
        if (error_a%message /= error_b%message) message = error_b%message//' in place of '//error_a%message
      else
        call compare(a, b, 'surface '//names(i)%s)
      end if
      n_surfaces = n_surfaces + 1
    end do

  contains

    !> Compare two surfaces.
    subroutine compare(s, t, what)
      type(surface_t), intent(in) :: s  !! Surface of the whole body.
      type(surface_t), intent(in) :: t  !! Surface of the layer.
      character(*), intent(in) :: what  !! What it is, for messages.
      integer :: f
      if (s%n_facets /= t%n_facets) then
        message = what//': '//to_text(t%n_facets)//' facets in place of '//to_text(s%n_facets)
        return
      end if
      if (any(s%kind /= t%kind)) message = what//': kinds'
      if (any(s%block /= t%block)) message = what//': blocks'
      if (any(s%entity /= t%entity)) message = what//': entities'
      if (s%order_elevated .neqv. t%order_elevated) message = what//': order elevation'
      if (allocated(s%tag)) then
        if (any(s%tag /= t%tag)) message = what//': tags'
      end if
      do f = 1, s%n_facets
        if (s%element(f) /= layer%whole%block(t%block(f))%element(t%element(f))) message = what//': elements'
        if (any(s%node(:, f) > 0 .neqv. t%node(:, f) > 0)) message = what//': padding'
        if (any(pack(s%node(:, f), s%node(:, f) > 0) /= layer%whole%node(pack(t%node(:, f), t%node(:, f) > 0)))) &
          message = what//': nodes'
      end do
    end subroutine compare
  end subroutine compare_layer
end module layer_check
