!> Balanced parts of a body of which each rank has read a share: elements move to the rank of their place on a Morton
!> curve.
!>
!> The way: `share_box` and the box of all ranks; `share_curve_t` on each rank, `part_bounds_t` on all; until its search
!> is over, the nodes of elements in front of its probes (`nodes_before`), summed over all ranks, narrow it; `parts_of`
!> tells where elements go, and `pack_for_rank` packs them for each other rank. `dotyk_mesh_surface_layer` unpacks what
!> all of them send. Nothing is as large as the body: there are some probes for each bound of two parts, elements are
!> sent once. The curve is so fine that parts are balanced where nearly all elements are in a small place.
module dotyk_mesh_share_split
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_sort, only: sort_order
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_body_part, only: element_centres
  use dotyk_mesh_boundary_candidates, only: boundary_candidates_t
  use dotyk_mesh_layer_share, only: layer_share_t, no_elements, pack_items, whole_numbers_t
  implicit none
  private
  public :: share_box, pack_for_rank

  integer, parameter :: bits = 17  !! Bits of each coordinate along the curve: places are exact as reals.
  !> Bits of a bound that are found at once, and those of the first step: all bits of three coordinates.
  integer, parameter :: bits_of_step = 4, first_shift = 48
  integer, parameter :: n_steps = 2**bits_of_step - 1  !! Probes of a bound at once.

  type, public :: share_curve_t  !! Places of the elements of a share on the curve.
    integer(int64), allocatable :: place(:)  !! Place of each element, counted through all blocks (n_elements).
    integer(int64), allocatable, private :: ascending(:)  !! The places in ascending order (n_elements).
    !> Nodes of the elements up to each place of them (0:n_elements).
    integer(int64), allocatable, private :: nodes_up_to(:)
  contains
    procedure :: init => curve_init
    procedure :: nodes_before => curve_nodes_before
  end type share_curve_t

  !> Bounds of the parts on the curve of one volume; all volumes lie on one line, one after the other, in equal lengths
  !> for each part.
  type, public :: part_bounds_t
    !> Where the nodes of elements in front are summed next: none where the search is over (any).
    integer(int64), allocatable :: probe(:)
    integer(int64), allocatable, private :: first(:)  !! First place of each part but the first one (n_parts - 1).
    integer, allocatable, private :: wanted(:)  !! Bounds that are searched for (any).
    !> Number of bodies that use the volume, and weight of the bodies before them and of all.
    integer(int64), private :: n_bodies = 0, before = 0, whole = 0
    integer, private :: shift = first_shift  !! Binary logarithm of the distance of probes.
  contains
    procedure :: init => bounds_init
    procedure :: narrow => bounds_narrow
    procedure :: parts_of => bounds_parts_of
  end type part_bounds_t

contains

  !> Box of the nodes of a share; huge and negative where it has none.
  pure subroutine share_box(own, low, high)
    type(body_mesh_t), intent(in) :: own  !! Elements of the share.
    real(dp), intent(out) :: low(:)  !! Lower corner (dimension) [length].
    real(dp), intent(out) :: high(:)  !! Upper corner (dimension) [length].
    low = minval(own%x, dim=2)
    high = maxval(own%x, dim=2)
  end subroutine share_box

  !> Find the places of the elements.
  subroutine curve_init(self, own, low, high)
    class(share_curve_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: own  !! Elements of the share.
    real(dp), intent(in) :: low(:)  !! Lower corner of the whole body (dimension) [length].
    real(dp), intent(in) :: high(:)  !! Upper corner of the whole body (dimension) [length].
    real(dp), allocatable :: centre(:, :)
    integer, allocatable :: weight(:), order(:)
    real(dp) :: scale
    integer :: e, d, i, cell
    call element_centres(own, centre, weight)
    scale = maxval(high - low)
    if (scale > 0) scale = (2**bits - 1)/scale
    allocate (self%place(size(weight)), source=0_int64)
    do e = 1, size(weight)
      do d = 1, own%dimension
        cell = max(0, min(2**bits - 1, int((centre(d, e) - low(d))*scale)))
        do i = 0, bits - 1
          if (btest(cell, i)) self%place(e) = ibset(self%place(e), own%dimension*i + d - 1)
        end do
      end do
    end do
    allocate (order(size(weight)), self%nodes_up_to(0:size(weight)))
    call sort_order(real(self%place, dp), order)
    self%ascending = self%place(order)
    self%nodes_up_to(0) = 0
    do e = 1, size(weight)
      self%nodes_up_to(e) = self%nodes_up_to(e - 1) + weight(order(e))
    end do
  end subroutine curve_init

  !> Nodes of the elements of the share in front of some places (n).
  pure function curve_nodes_before(self, place) result(n_nodes)
    class(share_curve_t), intent(in) :: self
    integer(int64), intent(in) :: place(:)  !! The places (n).
    integer(int64) :: n_nodes(size(place))
    integer :: i, low, high, middle
    do i = 1, size(place)
      low = 0
      high = size(self%ascending)
      do while (low < high)
        middle = low + (high - low + 1)/2
        if (self%ascending(middle) < place(i)) then
          low = middle
        else
          high = middle - 1
        end if
      end do
      n_nodes(i) = self%nodes_up_to(low)
    end do
  end function curve_nodes_before

  !> Begin the search for the bounds in a volume.
  subroutine bounds_init(self, n_parts, weight, n_bodies, before, whole)
    class(part_bounds_t), intent(out) :: self
    integer, intent(in) :: n_parts  !! Number of parts.
    integer(int64), intent(in) :: weight  !! Nodes of all elements of the volume.
    integer, intent(in) :: n_bodies  !! Number of bodies that use the volume.
    !> Weights of the bodies of the volumes before this one, and of all bodies.
    integer(int64), intent(in) :: before, whole
    integer :: p
    self%n_bodies = n_bodies
    self%before = before
    self%whole = whole
    allocate (self%first(n_parts - 1), source=0_int64)
    ! Parts that begin behind the volume have none of it; those that begin before it, all or the rest of it.
    where ([(p*whole, p=1, n_parts - 1)] >= n_parts*(before + n_bodies*weight)) self%first = huge(self%first)
    self%wanted = pack([(p, p=1, n_parts - 1)], [(p*whole, p=1, n_parts - 1)] >= n_parts*before .and. self%first == 0)
    call set_probes(self)
  end subroutine bounds_init

  !> Where to look next.
  pure subroutine set_probes(self)
    class(part_bounds_t), intent(inout) :: self
    integer :: i, k
    self%probe = [((self%first(self%wanted(i)) + ishft(int(k, int64), self%shift), k=1, n_steps), &
                   i=1, size(self%wanted))]
  end subroutine set_probes

  !> Narrow the search: the element in which the weight of the parts in front is reached is the first one of a part.
  pure subroutine bounds_narrow(self, n_nodes)
    class(part_bounds_t), intent(inout) :: self
    !> Nodes of the elements of all ranks in front of the probes (size of probe).
    integer(int64), intent(in) :: n_nodes(:)
    integer :: i, p, n_parts
    n_parts = size(self%first) + 1
    do i = 1, size(self%wanted)
      p = self%wanted(i)
      associate (in_front => n_nodes((i - 1)*n_steps + 1:i*n_steps))
        self%first(p) = self%first(p) + ishft(count(n_parts*(self%before + self%n_bodies*in_front) <= p*self%whole, &
                                                    kind=int64), self%shift)
      end associate
    end do
    if (self%shift == 0) self%wanted = [integer ::]
    self%shift = self%shift - bits_of_step
    call set_probes(self)
  end subroutine bounds_narrow

  !> Part of each element of a share.
  pure subroutine bounds_parts_of(self, curve, part)
    class(part_bounds_t), intent(in) :: self
    type(share_curve_t), intent(in) :: curve  !! The elements.
    !> Part of each element, from 0, counted through all blocks (n_elements).
    integer, allocatable, intent(out) :: part(:)
    integer :: e, low, high, middle
    allocate (part(size(curve%place)))
    do e = 1, size(part)
      ! Bounds ascend.
      low = 0
      high = size(self%first)
      do while (low < high)
        middle = low + (high - low + 1)/2
        if (self%first(middle) <= curve%place(e)) then
          low = middle
        else
          high = middle - 1
        end if
      end do
      part(e) = low
    end do
  end subroutine bounds_parts_of

  !> Pack the elements of a share that move to one rank.
  subroutine pack_for_rank(own, whole, file_node, n_file_nodes, part, rank, share)
    type(body_mesh_t), intent(in) :: own  !! Elements of the share.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body; those of nodes are not needed.
    integer, intent(in) :: file_node(:)  !! Number of each node in the file, ascending (n_nodes).
    integer, intent(in) :: n_file_nodes  !! Number of nodes of the file.
    integer, intent(in) :: part(:)  !! Part of each element (n_elements).
    integer, intent(in) :: rank  !! The rank that gets them.
    type(layer_share_t), intent(out) :: share  !! What is sent; nodes have their numbers in the file.
    type(whole_numbers_t) :: numbers
    type(boundary_candidates_t) :: nothing
    logical, allocatable :: has(:, :)
    integer :: b, n
    numbers%n_nodes = n_file_nodes
    numbers%node = file_node
    numbers%block = whole%block
    numbers%rank = rank
    allocate (numbers%node_rank(size(file_node)), numbers%global_node(size(file_node)), nothing%root(size(file_node)), &
              source=0)
    call no_elements(own, has)
    n = 0
    do b = 1, size(own%block)
      has(:size(own%block(b)%tag), b) = part(n + 1:n + size(own%block(b)%tag)) == rank
      n = n + size(own%block(b)%tag)
    end do
    call pack_items(own, numbers, has, spread(.false., 1, size(file_node)), nothing, 0, [integer(int64) ::], 0.0_dp, &
                    share)
  end subroutine pack_for_rank
end module dotyk_mesh_share_split
