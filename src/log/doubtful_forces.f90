!> Lines of the log about contact forces where the surfaces do not touch.
module dotyk_log_doubtful_forces
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_contact_doubtful_force, only: doubtful_force_t
  implicit none
  private
  public :: show_doubtful_forces

contains

  !> Pairs with forces where their surfaces do not touch.
  subroutine show_doubtful_forces(log, doubtful)
    type(log_t), intent(inout) :: log  !! The log.
    type(doubtful_force_t), intent(in) :: doubtful(:)  !! Forces of the pairs (n_pairs).
    !> Share of the force of a pair, and of that of the most loaded pair, from which on it gets a line; lines at most.
    real(dp), parameter :: large_share = 0.1_dp, considerable = 0.01_dp
    integer, parameter :: most_lines = 5
    integer, allocatable :: list(:)
    character(:), allocatable :: place
    integer :: i, c
    if (size(doubtful) == 0) return
    list = pack([(i, i=1, size(doubtful))], doubtful%share > large_share .and. &
                doubtful%share*doubtful%total > considerable*maxval(doubtful%total))
    do i = 1, min(size(list), most_lines)
      associate (at => doubtful(list(i)))
        place = to_text(at%position(1), 4)
        do c = 2, size(at%position)
          place = place//', '//to_text(at%position(c), 4)
        end do
        call log%line('  doubtful force   '//quoted(at%pair)//': '//to_text(100*at%share, 2)//' % of the contact '// &
                      'force is where the surfaces are '//to_text(at%gap, 2)//' apart, most of it at ('//place// &
                      '); facets are '//to_text(at%width, 2)//' long there')
      end associate
    end do
    if (size(list) > most_lines) &
      call log%line('                   and '//counted(size(list) - most_lines, 'other pair'))
    if (size(list) > 0) &
      call log%line('                   the contact is narrower than the facets, gaps are uncertain by these '// &
                    'distances at least, and the forces with them: refine the slave surface there')
  end subroutine show_doubtful_forces
end module dotyk_log_doubtful_forces
