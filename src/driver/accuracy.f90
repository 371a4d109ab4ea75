!> Meshes until the error is as small as asked for: each is solved, its errors give the sizes of the next one.
module dotyk_driver_accuracy
  use dotyk_base_error, only: error_t, exit_converged
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: aim_contact, last_linear_quantity, quantity_of_pair
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, quoted, text_t, to_text
  use dotyk_base_timer, only: wall_time
  use dotyk_control_adapted_sizes, only: adapted_sizes_t, resolved
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_contact_solution, only: contact_solution_t
  use dotyk_control_mesh_quantities, only: quantity_history_t
  use dotyk_driver_mesh_sizes, only: remove_views, write_views
  use dotyk_input_case, only: case_t
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private

  type, public :: accuracy_t  !! The meshes so far.
    integer :: n_meshes = 0  !! Number of meshes, the present one included.
    type(adapted_sizes_t), private :: sizes  !! What is known on the present mesh.
    type(quantity_history_t), private :: history  !! Quantities on the meshes so far.
    real(dp), private :: began = 0  !! When the first mesh began: wall time [s].
    integer, private :: n_unknowns = 0  !! Unknowns of the present mesh.
    integer, private :: n_before = 0  !! Elements of the mesh before.
    real(dp), private :: expected = 0, predicted = 0  !! Elements and error that were expected of the present mesh [].
    real(dp), private :: factor = 1  !! Elements of the last mesh over those that were expected [].
    type(text_t), allocatable, private :: view_file(:)  !! Files that gmsh reads for the present mesh (n).
  contains
    procedure :: begin_mesh => accuracy_begin_mesh
    procedure :: observe => accuracy_observe
    procedure :: conclude => accuracy_conclude
    procedure :: remove_views => accuracy_remove_views
  end type accuracy_t

  !> What is aimed at, as a fraction of what is asked for; and the least fraction of its prediction that a mesh is
  !> believed to have missed by, where the number of elements has changed by a factor in the range [].
  real(dp), parameter :: safety = 0.9_dp, greatest_miss = 0.6_dp, steady(2) = [0.6_dp, 8.0_dp]
  real(dp), parameter :: spare = 1.25_dp  !! Meshes are as large as expected within this factor [].
  real(dp), parameter :: growth(2:3) = [6.0_dp, 8.0_dp]  !! Elements of a mesh over those of the last one at most [].

contains

  !> A new mesh begins; errors and contact of the last one are forgotten.
  subroutine accuracy_begin_mesh(self, case)
    class(accuracy_t), intent(inout) :: self
    type(case_t), intent(inout) :: case  !! Gets the number of the mesh.
    type(adapted_sizes_t) :: nothing
    if (self%n_meshes == 0) self%began = wall_time()
    self%n_before = self%sizes%n_elements
    self%sizes = nothing
    call self%history%begin_mesh()
    self%n_meshes = self%n_meshes + 1
    case%mesh_number = self%n_meshes
  end subroutine accuracy_begin_mesh

  !> Take the errors of a load case, where an error is asked for.
  subroutine accuracy_observe(self, case, k, problem, solution, error)
    class(accuracy_t), intent(inout) :: self
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: k  !! The load case.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(contact_solution_t), intent(inout) :: solution  !! The solution of the load case; quantities get error bars.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the program cannot choose sizes.
    type(text_t) :: file(size(case%body))
    type(placement_t) :: placement(size(case%body))
    logical :: near_contact
    integer :: b
    if (.not. case%accuracy%is_given .or. .not. allocated(solution%state%pressure)) return
    do b = 1, size(file)
      file(b)%s = case%body(b)%mesh
      call placement(b)%init(case%body(b)%axis, case%body(b)%angle, case%body(b)%at)
    end do
    ! The energy does not care for pressures at the rim.
    near_contact = case%accuracy%aim == aim_contact .or. &
      any([(case%quantity(b)%is_goal .and. case%quantity(b)%kind > last_linear_quantity .and. &
            quantity_of_pair(case%quantity(b)%kind), b=1, size(case%quantity))])
    call self%sizes%observe(file, placement, problem, near_contact, k, case%accuracy%error, self%history, &
                            solution, error)
    self%n_unknowns = sum(problem%body%n_unknowns())
  end subroutine accuracy_observe

  !> Decide on the mesh that was solved: the last one, or the case gets what gmsh needs for the next.
  subroutine accuracy_conclude(self, case, code, log, reached, done, error)
    class(accuracy_t), intent(inout) :: self
    type(case_t), intent(inout) :: case  !! The case; its sizes are set.
    !> Exit code of the solution: the mesh is not the last one where the solution is not valid, as where contact forces
    !> depend on gaps that the mesh does not tell.
    integer, intent(in) :: code
    type(log_t), intent(inout) :: log  !! Gets a line.
    logical, intent(out) :: reached  !! Whether the error is as small as asked for.
    logical, intent(out) :: done  !! Whether the mesh is the last one.
    type(error_t), allocatable, intent(out) :: error  !! Where the sizes cannot be written.
    character(:), allocatable :: why, verdict, told
    real(dp) :: aim, miss, seconds, limit
    logical :: by_quantity
    by_quantity = any(case%quantity%is_goal)
    associate (sizes => self%sizes, asked => case%accuracy, now => real(self%sizes%n_elements, dp))
      seconds = wall_time() - self%began
      limit = merge(sqrt(asked%error), asked%error, by_quantity)
      told = percent(merge(sizes%error**2, sizes%error, sizes%has_goal))
      reached = sizes%error <= limit .and. (sizes%has_goal .eqv. by_quantity) .and. sizes%is_known .and. &
        sizes%is_confirmed .and. sizes%contact < resolved .and. code == exit_converged
      why = ''
      if (self%n_meshes >= asked%max_meshes) why = 'max_meshes = '//to_text(asked%max_meshes)
      if (asked%max_seconds > 0 .and. seconds >= asked%max_seconds) why = 'max_seconds = '//to_text(asked%max_seconds)
      if (spare*self%n_unknowns >= asked%max_unknowns) why = 'max_unknowns = '//to_text(asked%max_unknowns)
      if (self%n_meshes > 1 .and. sizes%n_elements == self%n_before .and. .not. reached) &
        why = 'the geometry, which fixes its mesh (Transfinite, Layers)'
      if (.not. (sizes%error > 0 .and. sizes%is_known) .and. .not. reached) why = 'the lack of an error estimate'
      if (allocated(sizes%without_limit)) &
        why = quoted(sizes%without_limit)//', which grows from mesh to mesh and has no limit'
      verdict = ''
      if (reached) verdict = '; reached: '//percent(asked%error)//' were asked for'
      if (.not. reached .and. len(why) > 0) &
        verdict = '; not reached: '//percent(asked%error)//' were asked for'// &
                  trim(merge(', and contact that is resolved', '                              ', &
                             sizes%contact >= resolved))//'; stopped by '//why
      call log%line('  accuracy         mesh '//to_text(self%n_meshes)//': '// &
                    counted(self%n_unknowns, 'unknown')//', error ~ '//told// &
                    trim(merge(' of a quantity', '              ', sizes%has_goal))// &
                    trim(merge(' near contact', '             ', asked%aim == aim_contact))//', contact '// &
                    percent(sizes%contact)//', after '//to_text(seconds, 3)//' s'//verdict)
      done = reached .or. len(why) > 0
      if (done) return
      ! Contact that the mesh does not resolve is no reason to coarsen what is good enough.
      aim = min(limit, sizes%error)
      if (.not. sizes%is_confirmed) aim = min(aim, sizes%error/sqrt(2.0_dp))
      if (self%n_meshes > 1) then
        self%factor = now/self%expected*self%factor
        miss = self%predicted/sizes%error
        associate (changed => now/self%n_before)
          if (changed < steady(1) .or. changed > steady(2)) miss = 1
        end associate
        aim = aim*safety*min(1.0_dp, max(greatest_miss, miss))
      end if
      call sizes%plan(aim, growth(case%scene%dimension)*now, now*asked%max_unknowns/self%n_unknowns, self%factor, &
                      self%n_meshes == 1)
      self%expected = sizes%expected
      self%predicted = sizes%predicted
    end associate
    call write_views(self%sizes%view, self%sizes%expected, case, self%view_file, error)
  end subroutine accuracy_conclude

  !> Remove what gmsh has read for the mesh.
  subroutine accuracy_remove_views(self)
    class(accuracy_t), intent(inout) :: self
    if (allocated(self%view_file)) call remove_views(self%view_file)
  end subroutine accuracy_remove_views

  !> A fraction in percent.
  function percent(fraction) result(text)
    real(dp), intent(in) :: fraction  !! The fraction [].
    character(:), allocatable :: text
    text = to_text(100*fraction, 2)//' %'
  end function percent
end module dotyk_driver_accuracy
