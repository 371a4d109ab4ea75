!> Groups and keys of load cases, for the table of all keys.
module dotyk_input_case_keywords
  use dotyk_input_keywords, only: keyword_list_t, kind_formula, kind_logical, kind_real, kind_text
  implicit none
  private
  public :: add_case, add_case_key, add_contact_case

  integer, parameter :: most_names = 200  !! Greatest number of names in a key `case`.

contains

  !> Keys of `&case`.
  pure subroutine add_case(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('case')
    call list%add('name', kind_text, required=.true., &
                  meaning='name of the load case; groups with the key case refer to it')
    call list%add('history', kind_logical, default='.false.', &
                  meaning='the solution starts from the contact pressures of the case before: the results are the '// &
                  'same to the tolerance, and where they are near each other it takes fewer iterations')
  end subroutine add_case

  !> The key `case` of other groups.
  pure subroutine add_case_key(list, meaning)
    type(keyword_list_t), intent(inout) :: list  !! The table so far; the group has begun.
    character(*), intent(in) :: meaning  !! What holds in the cases only.
    call list%add('case', kind_text, most=most_names, meaning=meaning)
  end subroutine add_case_key

  !> Keys of `&contact_case`.
  pure subroutine add_contact_case(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('contact_case')
    call list%add('case', kind_text, most=most_names, required=.true., &
                  meaning='load cases with this gap or theta; * and ? are wildcards')
    call list%add('contact', kind_text, required=.true., &
                  meaning='name of the contact pairs, with wildcards; pairs that are found have the names that '// &
                  '--check lists')
    call list%add('gap', kind_real, unit='length', &
                  meaning='initial gap, in place of that of &contact')
    call list%add('gap_formula', kind_formula, unit='length', &
                  meaning='initial gap as a formula, evaluated on surface_a')
    call list%add('theta', kind_real, unit='length/pressure', not_negative=.true., &
                  meaning='penalty parameter, in place of that of &contact')
    call list%add('theta_relative', kind_real, not_negative=.true., &
                  meaning='the same as a factor of size_a/E_a + size_b/E_b')
    call list%add('theta_mesh', kind_real, not_negative=.true., &
                  meaning='the same as a factor of h_a/E_a + h_b/E_b')
    call list%add('theta_formula', kind_formula, unit='length/pressure', &
                  meaning='the same as a formula, evaluated on surface_a')
  end subroutine add_contact_case
end module dotyk_input_case_keywords
