!> Measures the proximal active set with p-multigrid (`dotyk_scheme_proximal_active_set`) on blocks that stand on each
!> other:
!>
!>     benchmark_contact CELLS [KIND [BODIES [HOLDING [TOLERANCE [POISSON]]]]]
!>
!> BODIES blocks of KIND tet10, hex20 or quad8, CELLS cells along each edge and one more in every other block, HOLDING
!> pressed or floating. For theta from 1e-2 to 0: active sets, iterations of conjugate gradients in all, active sets
!> that came again, changes of the start, processor time of the start and of the solution. Threads: OMP_NUM_THREADS.
program contact_multigrid
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_timer, only: wall_time
  use dotyk_linalg_blas, only: set_blas_threads
  use dotyk_mesh_element, only: element_hex20, element_quad8, element_tet10
  use dotyk_scheme_corner_contact, only: solve_corner_contact
  use dotyk_scheme_proximal_active_set, only: proximal_outcome_t, solve_proximal
  use dotyk_scheme_proximal_motion, only: proximal_motion_t
  use test_multigrid_scene, only: floating, multigrid_scene_t, pressed, scene_settings_t
  implicit none

  type(multigrid_scene_t) :: scene
  type(scene_settings_t) :: settings
  type(proximal_outcome_t) :: outcome
  type(proximal_motion_t) :: motion
  type(error_t), allocatable :: error
  real(dp), parameter :: theta(4) = [1.0e-2_dp, 1.0e-4_dp, 1.0e-6_dp, 0.0_dp]
  real(dp), allocatable :: m(:), u(:)
  logical, allocatable :: start(:)
  real(dp) :: time(3), wall(2), tolerance
  integer :: b, k, n, kind
  call set_blas_threads(1)
  if (command_argument_count() == 0) then
    write (*, '(a)') 'usage: benchmark_contact CELLS [KIND [BODIES [HOLDING [TOLERANCE [POISSON]]]]]'
    stop 2, quiet=.true.
  end if
  kind = element_tet10
  if (argument(2) == 'hex20') kind = element_hex20
  if (argument(2) == 'quad8') kind = element_quad8
  n = nint(number(3, 2.0_dp))
  settings%kinds = [(kind, b=1, n)]
  settings%cells = [(nint(number(1, 8.0_dp)) + modulo(b, 2), b=1, n)]
  settings%holding = merge(floating, pressed, argument(4) == 'floating')
  settings%by_contact = .true.
  tolerance = number(5, 1.0e-8_dp)
  settings%poisson = number(6, 0.3_dp)
  call cpu_time(time(1))
  call scene%init(settings)
  call cpu_time(time(2))
  write (*, '(a,i0,a,i0,a,f0.1,a)') 'unknowns ', scene%system%n, ', rows ', scene%qp%n_rows, ', preparation ', &
    time(2) - time(1), ' s'
  write (*, '(a)') '   theta  sets  cg  cycles  start off  active  ended  start s  solution s  wall s'
  allocate (m(scene%qp%n_rows), u(scene%system%n))
  do k = 1, size(theta)
    call scene%qp%replace_theta(spread(theta(k), 1, scene%qp%n_rows))
    call cpu_time(time(1))
    call solve_corner_contact(scene%system, scene%qp, scene%gap, scene%load, m, u)
    call cpu_time(time(2))
    wall(1) = wall_time()
    start = m > 0
    motion = proximal_motion_t()
    call solve_proximal(scene%system, scene%qp, scene%gap, scene%load, tolerance, 60, motion, m, u, outcome, error)
    wall(2) = wall_time()
    call cpu_time(time(3))
    if (allocated(error)) error stop 'solution'
    write (*, '(es8.1,i6,i4,i8,i11,i8,i7,f9.2,f12.2,f8.2)') theta(k), outcome%steps, outcome%cg_steps, &
      outcome%n_cycles, count(start .neqv. m > 0), count(m > 0), outcome%ended, time(2) - time(1), time(3) - time(2), &
      wall(2) - wall(1)
  end do
  call scene%destroy()

contains

  !> An argument of the command line.
  function argument(i) result(text)
    integer, intent(in) :: i  !! Which one.
    character(:), allocatable :: text
    character(64) :: buffer
    buffer = ''
    call get_command_argument(i, buffer)
    text = trim(buffer)
  end function argument

  !> An argument that is a number.
  real(dp) function number(i, default)
    integer, intent(in) :: i  !! Which one.
    real(dp), intent(in) :: default  !! The number where the argument is missing.
    integer :: status
    character(64) :: text
    text = argument(i)
    read (text, *, iostat=status) number
    if (status /= 0) number = default
  end function number
end program contact_multigrid
