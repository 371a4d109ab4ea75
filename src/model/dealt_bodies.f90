!> Bodies of a scene of many small ones that are dealt out to the ranks before their meshes are read: each rank reads
!> and checks the volumes of its own bodies only, and gets the surfaces of the others. No rank ever has all volumes.
!>
!> Congruence classes are those that one process finds: bodies are compared in the same order, each by its own rank,
!> which reads the representative, too, where it may be congruent.
!>
!> Some of the bodies of a scene, from some volumes of its mesh files: what one rank builds of a scene of many bodies.
module dotyk_model_dealt_bodies
  use dotyk_base_error, only: error_t, problem_list_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t
  use dotyk_control_body_ranks, only: body_ranks_t, deal_bodies
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_congruence, only: are_congruent, congruence_invariants_t
  use dotyk_elasticity_load_cases, only: adopt_congruent_body
  use dotyk_input_case, only: case_t
  use dotyk_mesh_conversion, only: meshing_t
  use dotyk_mesh_held_part, only: surface_part
  use dotyk_mesh_joints, only: joints_t
  use dotyk_mesh_mesh, only: mesh_selection_t, mesh_t
  use dotyk_mesh_placement, only: placement_t
  use dotyk_model_body_setup, only: build_body, refuse_unused
  use dotyk_model_body_supports, only: load_names, support_names
  use dotyk_model_body_surfaces, only: body_surfaces_t, keep_surface
  use dotyk_model_joints, only: describe_joints
  use dotyk_model_mesh_file, only: add_unions, meshing_of, read_mesh
  use dotyk_model_mesh_survey, only: mesh_survey_t
  use dotyk_model_volumes, only: volume_t
  use dotyk_ranks_exchange, only: add_counts, by_owner, gather_all, is_own, meet, on_any_rank, share, share_parcel
  implicit none
  private
  public :: build_dealt_bodies

  !> Words of the surfaces that a rank sends at a time, at most, but for one body: they stand on all ranks beside what
  !> these hold.
  integer(int64), parameter :: most_words = 100000

  type :: chosen_bodies_t  !! The bodies of a scene, some of them built.
    type(body_t), allocatable :: body(:)  !! Bodies, not yet assembled; those that were not chosen are empty (n_bodies).
    type(body_surfaces_t), allocatable :: surfaces(:)  !! Their surfaces that contact pairs may need (n_bodies).
    !> How the parts of their volumes hang together, those of the first body of each volume (n_bodies).
    type(joints_t), allocatable :: joints(:)
    !> Whether each support and each load is that of a named body, or acts on one of the bodies that were built
    !> (n_supports), (n_loads).
    logical, allocatable :: support_used(:), load_used(:)
    type(problem_list_t) :: problems  !! What is wrong with them.
  contains
    procedure :: init => chosen_bodies_init
    procedure :: has => chosen_bodies_has
    procedure :: build => chosen_bodies_build
  end type chosen_bodies_t

contains

  !> Build the bodies.
  subroutine build_dealt_bodies(case, survey, body, surfaces, remarks, classes, ranks, modes, is_built)
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_survey_t), intent(in) :: survey  !! What the mesh files have.
    !> Bodies, not yet assembled: whole where this rank computes them, else their surfaces (n_bodies).
    type(body_t), allocatable, intent(out) :: body(:)
    type(body_surfaces_t), allocatable, intent(out) :: surfaces(:)  !! Surfaces that pairs may need (n_bodies).
    type(text_t), allocatable, intent(out) :: remarks(:)  !! Lines for the log (n_remarks).
    type(congruence_classes_t), intent(out) :: classes  !! Congruence classes.
    type(body_ranks_t), intent(out) :: ranks  !! Which rank computes which bodies.
    type(body_modes_t), allocatable, intent(out) :: modes(:)  !! Of bodies not held wholly, at held nodes (n_bodies).
    logical, intent(out) :: is_built  !! Not where a body is wrong: who builds all of them finds what.
    type(chosen_bodies_t) :: own
    logical, allocatable :: chosen(:)
    integer, allocatable :: owner(:)
    integer :: b
    is_built = .false.
    call deal_out(survey, owner, chosen)
    call own%init(case)
    call own%build(case, survey, chosen)
    if (on_any_rank(own%problems%count > 0)) return
    call add_used(own%support_used)
    call add_used(own%load_used)
    call refuse_unused(case%file, case%scene%analysis, case%support%line, own%support_used, &
                       support_names(case), case%support%place%dimension == case%scene%dimension - 1, own%problems)
    call refuse_unused(case%file, case%scene%analysis, case%load%line, own%load_used, load_names(case), &
                       case%load%place%dimension == case%scene%dimension - 1, own%problems)
    if (own%problems%count > 0) return
    call find_classes(case, survey, owner, own, classes)
    if (on_any_rank(own%problems%count > 0)) return
    call ranks%take_owners(owner, classes)
    allocate (modes(size(owner)), remarks(0))
    if (.not. interrupted()) then
      call share_surfaces(classes, ranks, own, modes)
      do b = 1, size(owner)
        if (survey%first_of_volume(b) == b) &
          call describe_joints(case, own%joints(b), count(survey%first_of_volume == b), b, remarks)
      end do
    end if
    call move_alloc(own%body, body)
    call move_alloc(own%surfaces, surfaces)
    is_built = .true.
  end subroutine build_dealt_bodies

  !> A rank for each body, by the elements that it has, and the bodies that this rank reads: its own, and those that
  !> may represent their congruence classes.
  subroutine deal_out(survey, owner, chosen)
    type(mesh_survey_t), intent(in) :: survey  !! What the mesh files have.
    integer, allocatable, intent(out) :: owner(:)  !! Rank of each body (n_bodies).
    logical, allocatable, intent(out) :: chosen(:)  !! Whether this rank reads a body (n_bodies).
    integer, allocatable :: alike(:)
    integer :: b, n
    n = size(survey%first_of_file)
    allocate (alike(n))
    do b = 1, n
      alike(b) = 1
      do while (alike(b) < b)
        if (alike(alike(b)) == alike(b) .and. survey%alike(alike(b), b)) exit
        alike(b) = alike(b) + 1
      end do
    end do
    owner = deal_bodies([(survey%expected_nodes(b), b=1, n)], alike)
    chosen = is_own(owner)
    do b = 1, n
      if (is_own(owner(b))) chosen(alike(b)) = .true.
    end do
  end subroutine deal_out

  !> Add what the bodies of other ranks use.
  subroutine add_used(used)
    logical, intent(inout) :: used(:)  !! That of this rank in, of all ranks out (n).
    integer(int64) :: n(size(used))
    n = merge(1, 0, used)
    call add_counts(n)
    used = n > 0
  end subroutine add_used

  !> Give the surfaces of the bodies of this rank to the others, and take theirs.
  subroutine share_surfaces(classes, ranks, own, modes)
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes.
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    !> The bodies of this rank in, all of them out: surfaces where this rank neither solves nor factorizes them.
    type(chosen_bodies_t), intent(inout) :: own
    type(body_modes_t), intent(inout) :: modes(:)  !! Rigid body modes of the surfaces (n_bodies).
    type(parcel_t), allocatable :: parcel
    type(body_modes_t) :: of_class
    integer(int64), allocatable :: word(:)
    integer, allocatable :: order(:)
    logical :: holds(size(ranks%owner)), of_rank(size(ranks%owner))
    logical, allocatable :: sample(:)
    integer :: b, i, n_sent, last_class
    holds = ranks%factorizes .or. is_own(ranks%owner)
    ! Classes one after the other: the modes of a representative serve all of its bodies.
    allocate (order(0))
    do b = 1, size(holds)
      if (.not. classes%is_representative(b)) cycle
      of_rank = classes%first == b .and. is_own(ranks%owner)
      order = [order, pack([(i, i=1, size(holds))], of_rank)]
    end do
    last_class = 0
    n_sent = 0
    do while (on_any_rank(n_sent < size(order)))
      allocate (parcel)
      do while (n_sent < size(order) .and. parcel%n_words() < most_words)
        n_sent = n_sent + 1
        b = order(n_sent)
        associate (first => classes%first(b))
          if (first /= last_class) call of_class%find(own%body(first))
          last_class = first
          call send_surface(b, first, classes%motion(b), own, of_class, parcel)
        end associate
      end do
      call gather_all(parcel%words(), word)
      call parcel%open(word)
      do while (.not. parcel%at_end())
        call take_surface(parcel, holds, own, modes)
      end do
      deallocate (parcel)
    end do
    do b = 1, size(holds)
      if (holds(b)) call surface_part(own%body(b)%mesh, sample, own%body(b)%shared_node)
    end do
  end subroutine share_surfaces

  !> Put the surface of a body into a parcel.
  subroutine send_surface(b, first, motion, own, of_class, parcel)
    integer, intent(in) :: b, first  !! The body, and the representative of its class.
    type(placement_t), intent(in) :: motion  !! Rigid motion between both.
    type(chosen_bodies_t), intent(inout) :: own  !! The bodies of this rank.
    type(body_modes_t), intent(in) :: of_class  !! Rigid body modes of the representative.
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    type(body_t) :: body
    type(body_surfaces_t) :: surfaces
    type(body_modes_t) :: modes
    integer :: number
    body = own%body(b)
    surfaces = own%surfaces(b)
    if (b == first) then
      modes = of_class
    else
      call modes%move(of_class, motion, body)
    end if
    call keep_surface(body, surfaces, modes)
    number = b
    call parcel%carry(number)
    call body%carry(parcel)
    call surfaces%carry(parcel)
    call modes%carry(parcel)
    call own%joints(b)%carry(parcel)
  end subroutine send_surface

  !> Take the surface of a body out of a parcel.
  subroutine take_surface(parcel, holds, own, modes)
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    logical, intent(in) :: holds(:)  !! Whether this rank has the whole body (n_bodies).
    type(chosen_bodies_t), intent(inout) :: own  !! The bodies.
    type(body_modes_t), intent(inout) :: modes(:)  !! Their rigid body modes, of bodies that are not whole (n_bodies).
    type(body_t) :: body
    type(body_surfaces_t) :: surfaces
    type(body_modes_t) :: of_body
    integer :: b
    b = 0
    call parcel%carry(b)
    call body%carry(parcel)
    call surfaces%carry(parcel)
    call of_body%carry(parcel)
    call own%joints(b)%carry(parcel)
    if (holds(b)) return
    own%body(b) = body
    own%surfaces(b) = surfaces
    modes(b) = of_body
  end subroutine take_surface

  !> Find the congruence classes. A rank that has bodies of a class has the representative, too, on return.
  subroutine find_classes(case, survey, owner, own, classes)
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_survey_t), intent(in) :: survey  !! What the mesh files have.
    integer, intent(in) :: owner(:)  !! Rank of each body (n_bodies).
    !> The bodies of this rank; those that are congruent to others get their equations and axes.
    type(chosen_bodies_t), intent(inout) :: own
    type(congruence_classes_t), intent(out) :: classes  !! The classes.
    type(congruence_invariants_t) :: invariants(size(owner))
    type(placement_t) :: motion(size(owner))
    logical, dimension(size(owner)) :: may_be, is_congruent, missing
    integer :: b, c
    call classes%init(size(owner))
    if (interrupted()) return
    call share_invariants(owner, own%body, invariants)
    do c = 1, size(owner)
      if (.not. classes%is_representative(c)) cycle
      may_be = [(b > c .and. classes%first(b) == b .and. invariants(c)%matches(invariants(b)), b=1, size(owner))]
      if (.not. any(may_be)) cycle
      missing = .false.
      missing(c) = any(may_be .and. is_own(owner)) .and. .not. own%has(c)
      if (on_any_rank(missing(c))) call own%build(case, survey, missing)
      if (on_any_rank(own%problems%count > 0)) return
      if (interrupted()) return
      is_congruent = .false.
      do b = c + 1, size(owner)
        if (.not. (may_be(b) .and. is_own(owner(b)))) cycle
        is_congruent(b) = are_congruent(own%body(c), invariants(c), own%body(b), invariants(b), motion(b))
        if (is_congruent(b)) call adopt_congruent_body(own%body(c), motion(b), own%body(b))
      end do
      call share(owner, is_congruent)
      call share_motions(owner, motion)
      do b = c + 1, size(owner)
        if (.not. is_congruent(b)) cycle
        classes%first(b) = c
        classes%motion(b) = motion(b)
      end do
    end do
  end subroutine find_classes

  !> Invariants of all bodies.
  subroutine share_invariants(owner, body, invariants)
    integer, intent(in) :: owner(:)  !! Rank of each body (n_bodies).
    type(body_t), intent(in) :: body(:)  !! Bodies, those of this rank built (n_bodies).
    type(congruence_invariants_t), intent(out) :: invariants(:)  !! Their invariants (n_bodies).
    type(parcel_t) :: parcel
    integer :: b, k, order(size(owner))
    do b = 1, size(owner)
      if (.not. is_own(owner(b))) cycle
      call invariants(b)%init(body(b))
      call invariants(b)%carry(parcel)
    end do
    call share_parcel(owner, parcel)
    if (parcel%at_end()) return
    order = by_owner(owner)
    do k = 1, size(order)
      call invariants(order(k))%carry(parcel)
    end do
  end subroutine share_invariants

  !> Motions of all bodies.
  subroutine share_motions(owner, motion)
    integer, intent(in) :: owner(:)  !! Rank of each body (n_bodies).
    type(placement_t), intent(inout) :: motion(:)  !! Those of the bodies of this rank in, of all out (n_bodies).
    type(parcel_t) :: parcel
    integer :: b, k, order(size(owner))
    do b = 1, size(owner)
      if (is_own(owner(b))) call motion(b)%carry(parcel)
    end do
    call share_parcel(owner, parcel)
    if (parcel%at_end()) return
    order = by_owner(owner)
    do k = 1, size(order)
      call motion(order(k))%carry(parcel)
    end do
  end subroutine share_motions

  !> Without any body so far.
  subroutine chosen_bodies_init(self, case)
    class(chosen_bodies_t), intent(out) :: self
    type(case_t), intent(in) :: case  !! The case.
    allocate (self%body(size(case%body)), self%surfaces(size(case%body)), self%joints(size(case%body)))
    self%support_used = .not. case%support%any_body
    self%load_used = .not. case%load%any_body
  end subroutine chosen_bodies_init

  !> Whether a body was built.
  pure logical function chosen_bodies_has(self, b) result(has)
    class(chosen_bodies_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    has = allocated(self%body(b)%mesh%x)
  end function chosen_bodies_has

  !> Build bodies. All ranks call it together; each may choose others, or none.
  subroutine chosen_bodies_build(self, case, survey, chosen)
    class(chosen_bodies_t), intent(inout) :: self
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_survey_t), intent(in) :: survey  !! What the mesh files have.
    logical, intent(in) :: chosen(:)  !! Which bodies (n_bodies).
    type(mesh_selection_t) :: selection
    type(meshing_t) :: meshing
    type(mesh_t) :: mesh
    type(error_t), allocatable :: failed
    logical :: of_file(size(chosen))
    integer :: b
    meshing = meshing_of(case)
    selection%everything = .false.
    selection%dimension = case%scene%dimension
    do b = 1, size(chosen)
      if (interrupted()) exit
      if (survey%first_of_file(b) /= b) cycle
      of_file = chosen .and. survey%first_of_file == b
      if (.not. any(of_file)) then
        ! The others meet where they read the file.
        call meet()
        cycle
      end if
      selection%volume = survey%volumes(case, of_file)
      call read_mesh(case%body(b)%mesh, case%scene%dimension, mesh, meshing, failed, selection)
      if (.not. allocated(failed)) then
        call add_unions(case, case%body(b)%mesh, mesh)
        call build_bodies_of(self, case, survey, mesh, of_file)
      end if
      call self%problems%add_error(failed)
    end do
  end subroutine chosen_bodies_build

  !> Build bodies of one file.
  subroutine build_bodies_of(self, case, survey, mesh, chosen)
    class(chosen_bodies_t), intent(inout) :: self
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_survey_t), intent(in) :: survey  !! What the mesh files have.
    type(mesh_t), intent(in) :: mesh  !! Their volumes.
    logical, intent(in) :: chosen(:)  !! Which bodies (n_bodies).
    type(volume_t) :: volume
    logical :: of_volume(size(chosen))
    integer :: c, k
    do c = 1, size(chosen)
      of_volume = chosen .and. survey%first_of_volume == c
      if (.not. any(of_volume)) cycle
      call volume%take(mesh, case%scene, case%body(c), survey%locks(c))
      self%joints(c) = volume%joints
      do k = c, size(chosen)
        if (of_volume(k)) call build_body(case, mesh, volume, k, self%body(k), self%surfaces(k), self%support_used, &
                                          self%load_used, self%problems)
      end do
    end do
  end subroutine build_bodies_of
end module dotyk_model_dealt_bodies
