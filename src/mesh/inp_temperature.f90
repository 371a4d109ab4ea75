!> Temperatures of an Abaqus or CalculiX deck, of *INITIAL CONDITIONS, TYPE=TEMPERATURE and of *TEMPERATURE.
!>
!> Fields have names: `initial_temperature`; `temperature step 2`, what acts at the end of the second step;
!> `temperature`, the same of the only step that has such cards. *TEMPERATURE goes on in later steps until OP=NEW; nodes
!> without it have their initial temperature. Steps that are a perturbation are passed over.
module dotyk_mesh_inp_temperature
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: quoted, to_text
  use dotyk_mesh_inp_card, only: inp_card_t
  use dotyk_mesh_node_values, only: node_values_t
  implicit none
  private

  !> Names of fields.
  character(*), parameter :: initial_name = 'initial_temperature', given_name = 'temperature', step_name = ' step '

  type, public :: inp_temperature_t  !! The field that is wanted, and what was read of it.
    character(:), allocatable, private :: name  !! Its name.
    !> Number of steps so far, and how many have *TEMPERATURE; whether the present one has, and is a perturbation.
    integer, private :: step = 0, n_with = 0
    logical, private :: has = .false., is_perturbation = .false.
    !> Whether the data of the present card are part of the field; whether they are initial temperatures.
    logical, private :: wanted = .false., is_initial = .false.
    logical, private :: met = .false.  !! Whether the step of the field was met.
    character(:), allocatable, private :: names  !! Names of the fields of the deck, each after a comma.
    type(node_values_t), private :: initial, given  !! Initial temperatures, and those of steps [temperature].
  contains
    procedure :: init => temperature_init
    procedure :: begin_step => temperature_begin_step
    procedure :: begin_card => temperature_begin_card
    procedure :: take => temperature_take
    procedure :: finish => temperature_finish
  end type inp_temperature_t

contains

  !> Begin without any.
  subroutine temperature_init(self, name)
    class(inp_temperature_t), intent(inout) :: self
    character(*), intent(in) :: name  !! Name of the field.
    self%name = name
    self%names = ''
  end subroutine temperature_init

  !> Begin a step.
  subroutine temperature_begin_step(self, card)
    class(inp_temperature_t), intent(inout) :: self
    type(inp_card_t), intent(in) :: card  !! The card *STEP.
    self%step = self%step + 1
    self%has = .false.
    self%is_perturbation = card%has('perturbation')
    if (self%name == name_of_step(self%step)) self%met = .not. self%is_perturbation
  end subroutine temperature_begin_step

  !> Begin a card of temperatures; its data lines are to be taken where they are part of the field.
  subroutine temperature_begin_card(self, card, wanted, fault)
    class(inp_temperature_t), intent(inout) :: self
    type(inp_card_t), intent(in) :: card  !! The card.
    logical, intent(out) :: wanted  !! Whether its data lines are part of the field.
    character(:), allocatable, intent(out) :: fault  !! What cannot be read; empty where all can.
    type(node_values_t) :: none
    fault = ''
    self%is_initial = card%keyword == 'initialconditions'
    if (self%is_initial) then
      wanted = .true.
      call note(initial_name)
    else
      wanted = .not. self%is_perturbation .and. self%name /= initial_name .and. &
               (self%name == given_name .or. .not. self%met .or. self%name == name_of_step(self%step))
      if (.not. self%is_perturbation) call note(name_of_step(self%step))
      if (.not. (self%is_perturbation .or. self%has)) self%n_with = self%n_with + 1
      self%has = .true.
    end if
    if (.not. wanted) return
    if (card%has('file') .or. card%has('user')) &
      fault = 'temperatures with FILE or USER are not read: write them as data lines'
    if (card%get('op') == 'NEW' .or. card%get('op') == 'new' .or. card%get('op') == 'New') self%given = none

  contains

    !> Note a name.
    subroutine note(text)
      character(*), intent(in) :: text  !! The name.
      if (index(self%names//', ', ', '//quoted(text)//', ') == 0) self%names = self%names//', '//quoted(text)
    end subroutine note
  end subroutine temperature_begin_card

  !> Take the temperature of a node.
  subroutine temperature_take(self, node, value)
    class(inp_temperature_t), intent(inout) :: self
    integer(int64), intent(in) :: node  !! Number of the node.
    real(dp), intent(in) :: value  !! Temperature [temperature].
    if (self%is_initial) then
      call self%initial%set(node, value)
    else
      call self%given%set(node, value)
    end if
  end subroutine temperature_take

  !> The field.
  subroutine temperature_finish(self, file, values, error)
    class(inp_temperature_t), intent(in) :: self
    character(*), intent(in) :: file  !! Path of the deck.
    type(node_values_t), intent(out) :: values  !! The values [temperature].
    !> Set where the deck has no such field, or several that may be meant.
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: names
    logical :: exists
    names = ', none'
    if (len(self%names) > 0) names = self%names
    if (self%n_with == 1) names = ', '//quoted(given_name)//self%names
    if (self%name == given_name .and. self%n_with > 1) then
      call set_error(error, file//': *TEMPERATURE is in '//to_text(self%n_with)//' steps: the field is one of '// &
                     names(3:), exit_bad_input)
      return
    end if
    if (self%name == initial_name) then
      exists = index(self%names, quoted(initial_name)) > 0
    else if (self%name == given_name) then
      exists = self%n_with == 1
    else
      exists = self%met .and. self%n_with > 0
    end if
    if (.not. exists) then
      call set_error(error, file//': the deck has no field '//quoted(self%name)//'; it has '//names(3:), exit_bad_input)
      return
    end if
    call values%overlay(self%initial)
    call values%overlay(self%given)
  end subroutine temperature_finish

  !> Name of the field of a step.
  pure function name_of_step(step) result(name)
    integer, intent(in) :: step  !! The step, from 1; 0 before the first one.
    character(:), allocatable :: name
    name = given_name
    if (step > 0) name = given_name//step_name//to_text(step)
  end function name_of_step
end module dotyk_mesh_inp_temperature
