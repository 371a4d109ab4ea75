!> Keys of `&solver` that the chosen scheme or stopping rule would ignore are mistakes of the input.
module dotyk_input_solver_checks
  use dotyk_base_options, only: linear_solver_auto, option_name, response_auto, response_full, response_multigrid, &
    scheme_auto, scheme_dual, scheme_names, scheme_neumann, scheme_robin, stop_increment, stop_paper
  use dotyk_input_case, only: solver_input_t
  use dotyk_input_groups, only: group_t
  use dotyk_input_references, only: input_t
  implicit none
  private
  public :: check_solver_keys

  !> Schemes with a relaxation parameter, which (41) is about.
  integer, parameter :: schemes_of_paper(2) = [scheme_neumann, scheme_robin]
  character(*), parameter :: names_of_paper = '''neumann'' or ''robin'''

contains

  !> Report every given key that has no effect.
  subroutine check_solver_keys(group, input, solver, wants_penalty_error)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(solver_input_t), intent(in) :: solver  !! What was read from it, with scheme and stopping rule resolved.
    logical, intent(in) :: wants_penalty_error  !! Whether the penalty error is estimated, by the dual scheme.
    character(:), allocatable :: name
    integer :: scheme
    if (group%is_usable('scheme')) then
      scheme = merge(scheme_dual, solver%scheme, solver%scheme == scheme_auto)
      name = 'scheme='''//option_name(scheme_names, scheme)//''''
      call check_relaxation('gamma')
      call check_relaxation('gamma_rule')
      call check_stop_rule()
      if (group%is_given('robin_gap') .and. scheme /= scheme_robin) &
        call input%report(group, 'robin_gap', 'robin_gap is for scheme=''robin''; '//name// &
                          ' does not use it: remove it, or set scheme=''robin''')
      if (group%is_given('max_unbalanced') .and. scheme /= scheme_dual) &
        call input%report(group, 'max_unbalanced', 'max_unbalanced is about floating bodies, for scheme=''dual''; '// &
                          name//' has none: remove it')
      call check_response()
      if (scheme /= scheme_dual .and. .not. wants_penalty_error .and. group%is_usable('linear_solver') .and. &
          solver%linear_solver /= linear_solver_auto) call input%report(group, 'linear_solver', 'linear_solver is '// &
          'for scheme=''dual'' and estimates of the penalty error, and this run has neither; remove it')
    end if

  contains

    !> gamma and gamma_rule.
    subroutine check_relaxation(key)
      character(*), intent(in) :: key  !! 'gamma' or 'gamma_rule'.
      if (.not. group%is_given(key) .or. any(scheme == schemes_of_paper)) return
      call input%report(group, key, key//' is for scheme='//names_of_paper//'; '//name// &
                        ' does not use it: remove it or choose another scheme')
    end subroutine check_relaxation

    !> Stopping rules: the active sets of the dual scheme have no increment, and (41) is a theorem on the paper's
    !> iteration.
    subroutine check_stop_rule()
      if (.not. group%is_given('stop_rule') .or. .not. group%is_usable('stop_rule')) return
      if (solver%stop_rule == stop_paper .and. all(scheme /= schemes_of_paper)) &
        call input%report(group, 'stop_rule', 'stop_rule=''paper'' is for scheme='//names_of_paper// &
                          ', which (41) is about; '//name//' has stop_rule=''residual''')
      if (solver%stop_rule == stop_increment .and. scheme == scheme_dual) &
        call input%report(group, 'stop_rule', 'stop_rule=''increment'' is for iterative schemes; '//name// &
                          ' has stop_rule=''residual'': choose this or another scheme')
    end subroutine check_stop_rule

    !> The compliance operator of a body: the dual scheme and robin form the matrices that they need.
    subroutine check_response()
      if (.not. group%is_usable('response') .or. solver%response == response_auto) return
      if (solver%response == response_multigrid) then
        if (scheme /= scheme_dual) &
          call input%report(group, 'response', 'response=''multigrid'' is for scheme=''dual'', and this run has '// &
                            name//'; remove one of them')
        if (solver%linear_solver /= linear_solver_auto) &
          call input%report(group, 'linear_solver', 'response=''multigrid'' solves the contact by displacements, '// &
                            'without the systems that linear_solver is about; remove linear_solver')
        return
      end if
      if (scheme == scheme_neumann) return
      if (scheme == scheme_dual .and. solver%response == response_full) return
      call input%report(group, 'response', 'response is for scheme=''neumann''; '//name// &
                        ' forms the dense compliances that it needs: remove response')
    end subroutine check_response
  end subroutine check_solver_keys
end module dotyk_input_solver_checks
