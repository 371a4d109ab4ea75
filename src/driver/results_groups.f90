!> Groups of the results file: contact pairs, provenance and timing (docs/results.md). Fields are in
!> `dotyk_driver_results_fields`, summary and history in `dotyk_driver_results_summary`.
module dotyk_driver_results_groups
  use dotyk_base_kinds, only: dp
  use dotyk_base_version, only: version, compiler, build_type
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_balance, only: balance_t
  use dotyk_control_contact_problem, only: contact_problem_t, tied_surfaces_t
  use dotyk_control_contact_solution, only: contact_solution_t
  use dotyk_control_pressures, only: pair_solution_t
  use dotyk_control_quantity_error, only: quantity_errors_t
  use dotyk_control_tie_forces, only: tie_force_t
  use dotyk_driver_arguments, only: command_line_text
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_load_report, only: load_resultant_t
  use dotyk_input_case, only: case_t
  use dotyk_linalg_blas, only: blas_name
  use dotyk_log_timing, only: n_stages, stage_names, timing_t
  use dotyk_output_results_file, only: results_file_t, contact_group
  use dotyk_ranks_communication, only: n_ranks
  implicit none
  private
  public :: write_forces, write_pairs, write_provenance, write_quantities, write_timing

contains

  !> Contact rows of all pairs.
  subroutine write_pairs(file, pair, first_row, solution, pair_solution)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    type(contact_solution_t), intent(in) :: solution  !! The solution, with the penalty parameters.
    !> Contact pressures, gaps and resultants of the pairs (n_pairs).
    type(pair_solution_t), intent(in) :: pair_solution(:)
    character(21), parameter :: half_axis(2) = ['patch_half_axis_long ', 'patch_half_axis_short']
    character(:), allocatable :: group
    integer :: i, k
    do k = 1, size(pair)
      group = contact_group(pair(k)%name)
      call file%add_group(group)
      call file%put_array(group, 'position', pair(k)%row_position)
      call file%put_array(group, 'normal', pair(k)%row_normal)
      call file%put_array(group, 'weight', pair(k)%row_weight)
      call file%put_array(group, 'theta', solution%qp%theta(first_row(k):first_row(k + 1) - 1))
      call file%put_array(group, 'gap_initial', pair(k)%row_gap)
      call file%put_array(group, 'gap_uncertainty', pair(k)%row_uncertainty())
      call file%put_array(group, 'gap', pair_solution(k)%gap)
      call file%put_array(group, 'pressure', pair_solution(k)%pressure)
      call file%put_array(group, 'pressure_projected', pair_solution(k)%projected)
      call file%put_attribute(group, 'force', pair_solution(k)%force)
      call file%put_attribute(group, 'radial_force', pair_solution(k)%radial_force)
      call file%put_attribute(group, 'moment', pair_solution(k)%moment)
      call file%put_attribute(group, 'centre_of_pressure', pair_solution(k)%centre)
      call file%put_attribute(group, 'active', pair_solution(k)%n_active)
      call file%put_attribute(group, 'contact_area', pair_solution(k)%area)
      call file%put_array(group, 'patch_area', pair_solution(k)%patch%area)
      call file%put_array(group, 'patch_force', pair_solution(k)%patch%force)
      call file%put_array(group, 'patch_centre', reshape([(pair_solution(k)%patch(i)%centre, &
                                                           i=1, size(pair_solution(k)%patch))], &
                                                         [3, size(pair_solution(k)%patch)]))
      do i = 1, 2
        call file%put_array(group, trim(half_axis(i)), pair_solution(k)%patch%half_axes(i))
      end do
      call file%put_attribute(group, 'peak_pressure', pair_solution(k)%peak)
      call file%put_attribute(group, 'peak_position', pair_solution(k)%peak_position)
      call file%put_attribute(group, 'peak_covered', pair_solution(k)%peak_covered)
      call file%put_attribute(group, 'least_gap', pair_solution(k)%least_gap)
      call file%put_attribute(group, 'gap_position', pair_solution(k)%gap_position)
      call file%put_attribute(group, 'theta', pair(k)%theta)
      call file%put_attribute(group, 'force_uncertainty', solution%gap_doubt(k)%force_change)
      call file%put_attribute(group, 'contact_area_uncertainty', solution%gap_doubt(k)%area_change)
      call file%put_attribute(group, 'displacement_uncertainty', solution%gap_doubt(k)%moved_change)
      call file%put_attribute(group, 'layer', pair(k)%is_layer)
      call file%put_attribute(group, 'points_not_projected', pair(k)%n_unprojected)
    end do
  end subroutine write_pairs

  !> Quantities with error bars.
  subroutine write_quantities(file, quantities)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(quantity_errors_t), intent(in) :: quantities  !! The quantities; nothing is written where there are none.
    character(:), allocatable :: names
    integer :: i
    if (.not. allocated(quantities%of)) return
    if (size(quantities%of) == 0) return
    call file%add_group('quantities')
    names = quantities%of(1)%name
    do i = 2, size(quantities%of)
      names = names//new_line('a')//quantities%of(i)%name
    end do
    call file%put_attribute('quantities', 'names', names)
    call file%put_array('quantities', 'value', quantities%of%value)
    call file%put_array('quantities', 'error', quantities%of%error)
    call file%put_array('quantities', 'estimate', quantities%of%estimate)
  end subroutine write_quantities

  !> Forces on the bodies: loads and supports one by one, and sums by bodies with strain energies; and those of ties.
  subroutine write_forces(file, problem, balance)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(contact_problem_t), intent(in) :: problem  !! Bodies, with the resultants of their loads, and ties.
    type(balance_t), intent(in) :: balance  !! Forces on them, if they are known.
    call write_body_forces(file, problem%body, balance)
    if (allocated(balance%body)) call write_motions(file, problem%body, balance)
    if (problem%n_ties() > 0 .and. allocated(balance%tie)) call write_ties(file, problem%tie, balance%tie)
  end subroutine write_forces

  !> Forces on the bodies.
  subroutine write_body_forces(file, body, balance)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(body_t), intent(in) :: body(:)  !! Bodies, with the resultants of their loads (n_bodies).
    type(balance_t), intent(in) :: balance  !! Forces on them, if they are known.
    type(load_resultant_t), allocatable :: all(:)
    integer, allocatable :: of(:)
    character(:), allocatable :: names
    integer :: b
    names = ''
    do b = 1, size(body)
      if (b > 1) names = names//new_line('a')
      names = names//body(b)%name
    end do
    call file%put_attribute('bodies', 'names', names)
    call begin(sum([(n_loads(body(b)), b=1, size(body))]))
    do b = 1, size(body)
      if (n_loads(body(b)) > 0) call take(b, body(b)%resultant)
    end do
    call write_resultants('loads')
    if (.not. allocated(balance%body)) return
    call begin(sum([(size(balance%body(b)%support), b=1, size(body))]))
    do b = 1, size(body)
      call take(b, balance%body(b)%support)
    end do
    call write_resultants('supports')
    call file%put_array('bodies', 'strain_energy', balance%body%energy)
    call file%put_array('bodies', 'spring_energy', balance%body%spring_energy)
    call write_sums('load', balance%body%load)
    call write_sums('contact', balance%body%contact)
    call write_sums('reaction', balance%body%reaction)
    call file%put_attribute('bodies', 'force_error', balance%force_error)
    call file%put_attribute('bodies', 'moment_error', balance%moment_error)

  contains

    !> Make room.
    subroutine begin(n)
      integer, intent(in) :: n  !! Number of resultants.
      if (allocated(all)) deallocate (all, of)
      allocate (all(n))
      allocate (of(n), source=0)
    end subroutine begin

    !> Take the resultants of a body.
    subroutine take(b, resultant)
      integer, intent(in) :: b  !! Index of the body.
      type(load_resultant_t), intent(in) :: resultant(:)  !! Its resultants (n).
      integer :: i, first
      first = count(of > 0)
      do i = 1, size(resultant)
        all(first + i) = resultant(i)
        of(first + i) = b
      end do
    end subroutine take

    !> Write the resultants `all` of the bodies `of`.
    subroutine write_resultants(group)
      character(*), intent(in) :: group  !! Name of their group.
      integer :: i
      names = ''
      do i = 1, size(all)
        if (i > 1) names = names//new_line('a')
        names = names//body(of(i))%name//':'//all(i)%place
      end do
      call file%put_attribute(group, 'names', names)
      call file%put_array(group, 'body', of)
      call file%put_array(group, 'force', columns([(all(i)%force, i=1, size(all))]))
      call file%put_array(group, 'moment', columns([(all(i)%moment, i=1, size(all))]))
      call file%put_array(group, 'radial_force', [(all(i)%radial, i=1, size(all))])
    end subroutine write_resultants

    !> Write one resultant of each body.
    subroutine write_sums(kind, resultant)
      character(*), intent(in) :: kind  !! What it sums up.
      type(load_resultant_t), intent(in) :: resultant(:)  !! The resultants (n_bodies).
      integer :: i
      call file%put_array('bodies', kind//'_force', columns([(resultant(i)%force, i=1, size(resultant))]))
      call file%put_array('bodies', kind//'_moment', columns([(resultant(i)%moment, i=1, size(resultant))]))
    end subroutine write_sums

    !> Vectors one after the other as columns (3, n).
    pure function columns(value)
      real(dp), intent(in) :: value(:)  !! Their components (3*n) [any].
      real(dp) :: columns(3, size(value)/3)
      columns = reshape(value, shape(columns))
    end function columns
  end subroutine write_body_forces

  !> Motions of rigid bodies; nothing where there is none.
  subroutine write_motions(file, body, balance)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(balance_t), intent(in) :: balance  !! Forces on them, and motions.
    integer, allocatable :: rigid(:)
    character(:), allocatable :: names
    real(dp), allocatable :: point(:, :), motion(:, :)
    integer :: b, i
    rigid = pack([(b, b=1, size(body))], body%constraint%rigid%is_set)
    if (size(rigid) == 0) return
    allocate (point(3, size(rigid)), motion(6, size(rigid)))
    names = ''
    do i = 1, size(rigid)
      if (i > 1) names = names//new_line('a')
      names = names//body(rigid(i))%name
      point(:, i) = body(rigid(i))%constraint%rigid%point
      motion(:, i) = balance%body(rigid(i))%motion
    end do
    call file%add_group('rigid_bodies')
    call file%put_attribute('rigid_bodies', 'names', names)
    call file%put_array('rigid_bodies', 'body', rigid)
    call file%put_array('rigid_bodies', 'point', point)
    call file%put_array('rigid_bodies', 'displacement', motion(:3, :))
    call file%put_array('rigid_bodies', 'rotation', motion(4:, :))
  end subroutine write_motions

  !> Ties and what they transmit.
  subroutine write_ties(file, tie, force)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    type(tie_force_t), intent(in) :: force(:)  !! What they transmit (n_ties).
    character(:), allocatable :: names
    integer :: k
    names = ''
    do k = 1, size(tie)
      if (k > 1) names = names//new_line('a')
      names = names//tie(k)%name
    end do
    call file%add_group('ties')
    call file%put_attribute('ties', 'names', names)
    call file%put_array('ties', 'force', reshape([(force(k)%resultant%force, k=1, size(tie))], [3, size(tie)]))
    call file%put_array('ties', 'moment', reshape([(force(k)%resultant%moment, k=1, size(tie))], [3, size(tie)]))
    call file%put_array('ties', 'radial_force', [(force(k)%resultant%radial, k=1, size(tie))])
    call file%put_array('ties', 'bolt', [(merge(1, 0, tie(k)%is_bolt), k=1, size(tie))])
    call file%put_array('ties', 'tension', [(force(k)%tension, k=1, size(tie))])
    call file%put_array('ties', 'shortening', [(force(k)%shortening, k=1, size(tie))])
    call file%put_array('ties', 'area_tied', [(tie(k)%tied, k=1, size(tie))])
    call file%put_array('ties', 'distance', [(tie(k)%distance, k=1, size(tie))])
  end subroutine write_ties

  !> Number of loads of a body.
  pure integer function n_loads(body) result(n)
    type(body_t), intent(in) :: body  !! The body.
    n = 0
    if (allocated(body%resultant)) n = size(body%resultant)
  end function n_loads

  !> Version, command line, compiler, BLAS, threads and input.
  subroutine write_provenance(file, case, threads, started)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(case_t), intent(in) :: case  !! The case, with the text of its namelist file.
    integer, intent(in) :: threads  !! Number of threads.
    character(*), intent(in) :: started  !! Date and time of the start.
    call file%put_attribute('', 'version', version)
    call file%put_attribute('', 'command_line', command_line_text())
    call file%put_attribute('', 'compiler', compiler//' ('//build_type//')')
    call file%put_attribute('', 'blas', blas_name())
    call file%put_attribute('', 'ranks', n_ranks())
    call file%put_attribute('', 'threads', threads)
    call file%put_attribute('', 'started', started)
    call file%put_attribute('', 'input', case%text)
  end subroutine write_provenance

  !> Wall times of the phases.
  subroutine write_timing(file, timing)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(timing_t), intent(in) :: timing  !! Wall times of the phases.
    integer :: k
    do k = 1, n_stages
      call file%put_attribute('timing', trim(stage_names(k)), timing%stage(k)%wall)
    end do
    call file%put_attribute('timing', 'total', timing%total%wall)
  end subroutine write_timing
end module dotyk_driver_results_groups
