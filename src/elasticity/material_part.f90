!> The elements of a body that have one of its materials: strains and stresses are smooth in each material, not across
!> the faces where two of them meet.
module dotyk_elasticity_material_part
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: elements_of_material, mesh_of_material, nodes_of_material

contains

  !> The elements of a material, counted through all blocks of the body (n).
  pure function elements_of_material(mesh, material) result(element)
    type(body_mesh_t), intent(in) :: mesh  !! Elements of the body.
    integer, intent(in) :: material  !! Number of the material.
    integer, allocatable :: element(:)
    integer :: b, e, before
    allocate (element(0))
    before = 0
    do b = 1, size(mesh%block)
      associate (n => size(mesh%block(b)%tag))
        if (mesh%block(b)%material == material) element = [element, [(before + e, e=1, n)]]
        before = before + n
      end associate
    end do
  end function elements_of_material

  !> Whether each node belongs to an element of a material (n_nodes).
  pure function nodes_of_material(mesh, material) result(has)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: material  !! Number of the material.
    logical, allocatable :: has(:)
    integer :: b, e
    allocate (has(mesh%n_nodes()), source=.false.)
    do b = 1, size(mesh%block)
      if (mesh%block(b)%material /= material) cycle
      do e = 1, size(mesh%block(b)%node, 2)
        has(mesh%block(b)%node(:, e)) = .true.
      end do
    end do
  end function nodes_of_material

  !> The elements of a material with all nodes of the body.
  function mesh_of_material(mesh, material) result(part)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: material  !! Number of the material.
    type(body_mesh_t) :: part
    integer :: b, n
    if (allocated(mesh%file)) part%file = mesh%file
    part%dimension = mesh%dimension
    part%order_elevated = mesh%order_elevated
    part%x = mesh%x
    part%node_tag = mesh%node_tag
    allocate (part%block(count(mesh%block%material == material)))
    n = 0
    do b = 1, size(mesh%block)
      if (mesh%block(b)%material /= material) cycle
      n = n + 1
      part%block(n) = mesh%block(b)
    end do
    if (.not. allocated(mesh%whole)) return
    part%whole = mesh%whole
    part%whole%own_element = mesh%whole%own_element(elements_of_material(mesh, material))
    part%whole%element = mesh%whole%element(elements_of_material(mesh, material))
    part%whole%n_of_block = pack(mesh%whole%n_of_block, mesh%block%material == material)
  end function mesh_of_material
end module dotyk_elasticity_material_part
