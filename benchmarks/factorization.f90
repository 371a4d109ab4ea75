!> Times the numeric factorization of the bodies of a scene by the multifrontal code of `linalg` and by
!> cholmod_factorize, from the same symbolic analysis, in turns:
!>
!>     benchmark_factorization THREADS ROUNDS COPIES FILE.nml [PHASE...]
!>
!> One line for each factorization of all bodies: file, copies of the scene, factorized bodies, unknowns of all bodies
!> and of the largest one, operations, entries and bytes of the factors, threads, round, numeric phase, wall seconds,
!> processor seconds, peak memory beside K [bytes], relative residual of a solution. Congruent bodies are factorized
!> once, as in a run. The numeric phases:
!>
!>   multifrontal   bodies side by side, idle threads help with the bodies of others, as in a run
!>   cholmod        bodies side by side, one thread and one BLAS thread each
!>   cholmod_blas   bodies one after the other, BLAS on all threads
!>
!> All three unless PHASE names some.
program factorization
  use omp_lib, only: omp_set_num_threads
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: text_t
  use dotyk_base_timer, only: wall_time
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_response_choice, only: form_direct, operator_slot_t
  use dotyk_model_assembly, only: assemble_bodies
  use dotyk_model_body_setup, only: body_surfaces_t, build_bodies
  use dotyk_elasticity_body, only: body_t, stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_node_ordering, only: fill_reducing_order
  use dotyk_input_case, only: case_t
  use dotyk_input_parse, only: read_case
  use dotyk_linalg_blas, only: set_blas_threads
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_ordering, only: expand_permutation
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use multigrid_clock, only: memory_of, reset_peak
  implicit none

  !> Relative increase of the diagonal that makes the stiffness of floating bodies definite; values play no part in
  !> times.
  real(dp), parameter :: hold = 1.0e-6_dp
  character(12), parameter :: phase_name(3) = [character(12) :: 'multifrontal', 'cholmod', 'cholmod_blas']

  !> A body to factorize.
  type :: matrix_t
    !> Stiffness K, made definite.
    type(sparse_symmetric_t) :: stiffness
    !> The equation that comes k-th (n).
    integer, allocatable :: permutation(:)
  end type matrix_t

  type(matrix_t), allocatable :: matrix(:)
  type(error_t), allocatable :: error
  character(:), allocatable :: file
  integer :: threads, rounds, copies, round, i
  integer, allocatable :: phases(:)

  threads = integer_argument(1)
  rounds = integer_argument(2)
  copies = integer_argument(3)
  file = argument(4)
  call omp_set_num_threads(threads)
  call set_blas_threads(1)
  call read_matrices(file, matrix, error)
  if (allocated(error)) then
    write (*, '(a)') error%message
    stop 2, quiet=.true.
  end if
  phases = [(i, i=1, size(phase_name))]
  if (command_argument_count() > 4) phases = [(phase_of(argument(i)), i=5, command_argument_count())]
  do round = 1, rounds
    ! Each goes first in its turn.
    do i = 1, size(phases)
      call measure(phases(modulo(i + round - 2, size(phases)) + 1))
    end do
  end do

contains

  !> An argument of the command line.
  function argument(i) result(text)
    !> Which one.
    integer, intent(in) :: i
    character(:), allocatable :: text
    character(4096) :: buffer
    call get_command_argument(i, buffer)
    text = trim(buffer)
  end function argument

  !> An argument that is a number.
  integer function integer_argument(i) result(number)
    !> Which one.
    integer, intent(in) :: i
    character(32) :: text
    text = argument(i)
    read (text, *) number
  end function integer_argument

  !> Number of a numeric phase.
  integer function phase_of(name) result(phase)
    !> Its name.
    character(*), intent(in) :: name
    do phase = 1, size(phase_name)
      if (phase_name(phase) == name) return
    end do
    write (*, '(a)') 'no numeric phase is called '//name
    stop 2, quiet=.true.
  end function phase_of

  !> Stiffness matrices and fill-reducing orders, as in a run.
  subroutine read_matrices(file, matrix, error)
    !> Input file.
    character(*), intent(in) :: file
    !> Bodies that have a factor of their own.
    type(matrix_t), allocatable, intent(out) :: matrix(:)
    !> As in a run: a problem with the input, a mesh or the memory.
    type(error_t), allocatable, intent(out) :: error
    type(case_t) :: case
    type(body_t), allocatable :: body(:)
    type(body_surfaces_t), allocatable :: surfaces(:)
    type(congruence_classes_t) :: classes
    type(body_ranks_t) :: ranks
    type(body_modes_t), allocatable :: modes(:)
    type(stiffness_t), allocatable :: stiffness(:)
    type(operator_slot_t), allocatable :: slot(:)
    type(text_t), allocatable :: remarks(:)
    integer, allocatable :: node_order(:)
    integer :: b, n
    call read_case(file, case, error)
    if (.not. allocated(error)) call build_bodies(case, body, surfaces, remarks, error)
    if (allocated(error)) return
    call classes%init(size(body))
    call classes%find(body)
    call ranks%init(body, classes)
    call assemble_bodies(case, classes, ranks, spread(form_direct, 1, size(body)), body, modes, stiffness, slot, error)
    if (allocated(error)) return
    allocate (matrix(count([(classes%is_representative(b), b=1, size(body))])))
    n = 0
    do b = 1, size(body)
      if (.not. classes%is_representative(b)) cycle
      n = n + 1
      allocate (node_order(size(stiffness(b)%graph_start) - 1), matrix(n)%permutation(body(b)%constraint%n_equations))
      call fill_reducing_order(body(b)%mesh, stiffness(b)%graph_start, stiffness(b)%graph_neighbour, node_order, error)
      if (allocated(error)) return
      call expand_permutation(node_order, body(b)%constraint%equation, matrix(n)%permutation)
      matrix(n)%stiffness = stiffness(b)%matrix
      associate (k => matrix(n)%stiffness)
        k%value(k%column_start(:k%n) + 1) = (1 + hold)*k%value(k%column_start(:k%n) + 1)
      end associate
      deallocate (node_order)
    end do
  end subroutine read_matrices

  !> Factorize all bodies once, and write a line.
  subroutine measure(phase)
    !> Number of its name.
    integer, intent(in) :: phase
    type(cholesky_t), allocatable :: factor(:)
    integer, allocatable :: order(:)
    real(dp) :: wall, processor, start, begun
    integer(int64) :: memory, peak
    logical :: by_cholmod
    integer :: i, n
    n = size(matrix)
    allocate (factor(n*copies), order(n*copies))
    do i = 1, size(factor)
      call factor(i)%analyze(matrix(1 + modulo(i - 1, n))%stiffness, matrix(1 + modulo(i - 1, n))%permutation, error)
      if (allocated(error)) return
    end do
    call sort_by_work(factor%flops, order)
    by_cholmod = phase > 1
    call set_blas_threads(merge(threads, 1, phase == 3))
    call reset_peak()
    memory = memory_of('VmRSS:')
    call cpu_time(begun)
    start = wall_time()
    if (phase == 3) then
      do i = 1, size(factor)
        call factorize_one(factor(order(i)), 1 + modulo(order(i) - 1, n), by_cholmod)
      end do
    else
      !$omp parallel default(none) shared(factor, order, n, by_cholmod)
      !$omp single
      do i = 1, size(factor)
        !$omp task default(none) shared(factor, order, n, by_cholmod) firstprivate(i)
        call factorize_one(factor(order(i)), 1 + modulo(order(i) - 1, n), by_cholmod)
        !$omp end task
      end do
      !$omp end single
      !$omp end parallel
    end if
    wall = wall_time() - start
    call cpu_time(processor)
    processor = processor - begun
    peak = memory_of('VmHWM:') - memory
    call set_blas_threads(1)
    write (*, '(a, 4(1x, i0), 1x, es12.5, 4(1x, i0), 1x, a, 2(1x, f0.4), 1x, i0, 1x, es8.1)') file, copies, &
      size(factor), sum(factor%n), maxval(factor%n), sum(factor%flops), sum(factor%factor_entries), &
      sum(factor%factor_bytes), threads, round, trim(phase_name(phase)), wall, processor, peak, &
      residual(factor(size(factor)), matrix(n)%stiffness)
    do i = 1, size(factor)
      call factor(i)%destroy()
    end do
  end subroutine measure

  !> Factorize one body.
  subroutine factorize_one(factor, m, by_cholmod)
    !> Analysed.
    type(cholesky_t), intent(inout) :: factor
    !> Its matrix.
    integer, intent(in) :: m
    !> By `cholmod_factorize`.
    logical, intent(in) :: by_cholmod
    type(error_t), allocatable :: failed
    integer :: failed_column
    if (by_cholmod) then
      call factor%factorize_by_cholmod(matrix(m)%stiffness, failed_column, failed)
    else
      call factor%factorize(matrix(m)%stiffness, failed_column, failed)
    end if
    if (allocated(failed) .or. failed_column > 0) error stop 'a factorization failed'
  end subroutine factorize_one

  !> Relative residual of a solution.
  real(dp) function residual(factor, stiffness)
    !> Factor of K.
    type(cholesky_t), intent(in) :: factor
    !> K.
    type(sparse_symmetric_t), intent(in) :: stiffness
    real(dp), allocatable :: x(:), b(:), product(:)
    integer :: i
    allocate (product(factor%n))
    b = [(real(1 + modulo(i, 7), dp), i=1, factor%n)]
    x = b
    call factor%solve(x)
    call stiffness%multiply(x, product)
    residual = maxval(abs(product - b))/maxval(abs(b))
  end function residual

  !> Order by falling work.
  subroutine sort_by_work(work, order)
    !> Operations (n).
    real(dp), intent(in) :: work(:)
    !> Places in it (n).
    integer, intent(out) :: order(:)
    logical :: taken(size(work))
    integer :: i
    taken = .false.
    do i = 1, size(work)
      order(i) = maxloc(work, 1, mask=.not. taken)
      taken(order(i)) = .true.
    end do
  end subroutine sort_by_work
end program factorization
