!> Temperatures and initial stresses in the log.
module dotyk_log_initial_states
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, to_text
  use dotyk_elasticity_body, only: body_t
  implicit none
  private
  public :: show_initial_states

  !> Greatest number of bodies with a line each; more are summed up by the last line.
  integer, parameter :: most_shown = 20

contains

  !> One line for each body that has any.
  subroutine show_initial_states(log, body)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    character(:), allocatable :: line
    character(20) :: label
    integer :: b, n
    n = 0
    do b = 1, size(body)
      associate (state => body(b)%initial)
        if (.not. state%is_set()) cycle
        n = n + 1
        if (n == 1) then
          call log%line('')
          call log%line('  body                 temperature, initial stress')
        end if
        if (n > most_shown) cycle
        line = 'no temperature'
        if (allocated(state%temperature)) line = to_text(state%range(1), 6)
        if (state%range(2) > state%range(1)) line = line//' to '//to_text(state%range(2), 6)
        if (allocated(state%stress)) line = line//', initial stress'
        label = body(b)%name
        call log%line('  '//label//' '//line)
      end associate
    end do
    if (n > most_shown) call log%line('  ... '//counted(n - most_shown, 'more body', 'more bodies'))
  end subroutine show_initial_states
end module dotyk_log_initial_states
