!> Bodies that are dealt out to the ranks before their meshes are read, under mpirun, against those that are left where
!> each rank reads all of them: the same to the bit.
program dealt_bodies
  use, intrinsic :: iso_fortran_env, only: output_unit
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: int64
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_input_case, only: case_t
  use dotyk_input_parse, only: read_case
  use dotyk_model_body_setup, only: build_bodies
  use dotyk_model_body_surfaces, only: body_surfaces_t, hold_parts
  use dotyk_model_dealt_bodies, only: build_dealt_bodies
  use dotyk_model_mesh_survey, only: mesh_survey_t
  use dotyk_ranks_communication, only: end_ranks, start_ranks, this_rank
  implicit none

  type(case_t) :: case, faulty
  type(error_t), allocatable :: error
  integer :: n_failed, code, k
  n_failed = 0
  call start_ranks()
  call read_case('distributed/dealt.nml', case, error)
  if (allocated(error)) error stop 'distributed/dealt.nml'
  call test_bodies(case)
  faulty = case
  faulty%support(1)%place%name = 'nowhere'
  call test_fault(faulty, 'a surface that is not there')
  faulty = case
  faulty%body(9)%volume = 'nothing'
  call test_fault(faulty, 'a volume that is not there')
  faulty = case
  do k = 1, size(faulty%load)
    if (faulty%load(k)%any_body) faulty%load(k)%place%name = '77'
  end do
  call test_fault(faulty, 'a load on no body')
  code = min(1, n_failed)
  call end_ranks(code)
  stop code, quiet=.true.

contains

  !> Build the bodies in both ways.
  subroutine test_bodies(case)
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_survey_t) :: survey
    type(body_t), allocatable :: body(:), expected(:)
    type(body_surfaces_t), allocatable :: surfaces(:), expected_surfaces(:)
    type(text_t), allocatable :: remarks(:), expected_remarks(:)
    type(congruence_classes_t) :: classes, expected_classes
    type(body_ranks_t) :: ranks, expected_ranks
    type(body_modes_t), allocatable :: modes(:), expected_modes(:)
    type(error_t), allocatable :: error
    logical, allocatable :: is_here(:)
    logical :: is_built
    integer :: b
    call survey%read(case)
    call build_dealt_bodies(case, survey, body, surfaces, remarks, classes, ranks, modes, is_built)
    call check(is_built, 'bodies are built')
    if (.not. is_built) return
    call build_bodies(case, expected, expected_surfaces, expected_remarks, error)
    call check(.not. allocated(error), 'the case')
    call expected_classes%find(expected)
    call check(all(classes%first == expected_classes%first), 'congruence classes')
    call check(classes%n() > 4 .and. classes%n() < size(body), 'classes of several bodies')
    ! Its representative is not the first body with as many elements: ranks read it when they compare.
    call check(any(classes%first == 2 .and. ranks%owner /= ranks%owner(2)), 'a class on several ranks')
    is_here = ranks%factorizes .or. ranks%is_own([(b, b=1, size(body))])
    call check(.not. all(is_here), 'volumes that are not here')
    call expected_ranks%take_owners(ranks%owner, expected_classes)
    call hold_parts(expected_classes, expected_ranks, expected, expected_surfaces, expected_modes)
    do b = 1, size(body)
      associate (a => classes%motion(b), e => expected_classes%motion(b))
        call check((a%rotated .eqv. e%rotated) .and. all(abs(a%rotation - e%rotation) <= 0) .and. &
                   all(abs(a%shift - e%shift) <= 0), 'motion of '//case%body(b)%name)
      end associate
      ! Numbers in what was read of the file.
      call check(size(body(b)%mesh%mesh_node) == size(expected(b)%mesh%mesh_node), 'nodes of the file')
      deallocate (body(b)%mesh%mesh_node, expected(b)%mesh%mesh_node)
      call check((body(b)%mesh%is_whole() .eqv. is_here(b)) .and. &
                 (expected(b)%mesh%is_whole() .eqv. is_here(b)), 'what is held of '//case%body(b)%name)
      call check(alike(words(body(b), surfaces(b), modes(b), .not. is_here(b)), &
                       words(expected(b), expected_surfaces(b), expected_modes(b), .not. is_here(b))), &
                 case%body(b)%name)
    end do
    call check(size(remarks) == size(expected_remarks), 'remarks')
  end subroutine test_bodies

  !> No rank builds the bodies where one of them is wrong.
  subroutine test_fault(case, what)
    type(case_t), intent(in) :: case  !! The case.
    character(*), intent(in) :: what  !! What is wrong.
    type(mesh_survey_t) :: survey
    type(body_t), allocatable :: body(:)
    type(body_surfaces_t), allocatable :: surfaces(:)
    type(text_t), allocatable :: remarks(:)
    type(congruence_classes_t) :: classes
    type(body_ranks_t) :: ranks
    type(body_modes_t), allocatable :: modes(:)
    logical :: is_built
    call survey%read(case)
    call build_dealt_bodies(case, survey, body, surfaces, remarks, classes, ranks, modes, is_built)
    call check(.not. is_built, what)
  end subroutine test_fault

  !> All that a rank has of a body (n).
  function words(body, surfaces, modes, with_modes) result(word)
    type(body_t), intent(inout) :: body  !! The body.
    type(body_surfaces_t), intent(inout) :: surfaces  !! Its surfaces.
    type(body_modes_t), intent(inout) :: modes  !! Its rigid body modes.
    logical, intent(in) :: with_modes  !! Whether they are found.
    integer(int64), allocatable :: word(:)
    type(parcel_t) :: parcel
    call body%carry(parcel)
    call surfaces%carry(parcel)
    if (with_modes) call modes%carry(parcel)
    word = parcel%words()
  end function words

  !> Whether lists are the same.
  pure logical function alike(a, b)
    integer(int64), intent(in) :: a(:), b(:)  !! The lists.
    alike = size(a) == size(b)
    if (alike) alike = all(a == b)
  end function alike

  !> Count a failure.
  subroutine check(holds, what)
    logical, intent(in) :: holds  !! Whether it holds.
    character(*), intent(in) :: what  !! What.
    if (holds) return
    n_failed = n_failed + 1
    write (output_unit, '(a, i0, a)') 'rank ', this_rank(), ': failed: '//what
  end subroutine check
end program dealt_bodies
