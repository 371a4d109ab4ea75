!> From assembled bodies to responses: order, analyse, factorize.
module dotyk_driver_factorization
  use dotyk_base_error, only: error_slot_t, error_t, problem_list_t, exit_machine, set_error
  use dotyk_base_interrupt, only: interrupted, stop_if_interrupted
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_log, only: log_t
  use dotyk_base_memory, only: memory_now, memory_t, memory_text, set_item
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_driver_congruence_classes, only: congruence_classes_t
  use dotyk_driver_parallel, only: largest_first, set_blas_threads
  use dotyk_elasticity_body, only: body_t
  use dotyk_response_definite, only: digits_t
  use dotyk_response_demand, only: response_demand_t
  use dotyk_response_full, only: full_response_t
  use dotyk_response_response, only: response_slot_t
  use dotyk_response_soft_motions, only: tell_apart
  implicit none
  private

  !> What is known of a factor before it is made. It is that of the first body of a kind; the others have but what their responses go
  !> through.
  type, public :: factor_size_t
    !> Entries that are stored, and their memory [bytes].
    integer(int64) :: entries = 0, bytes = 0
    !> Memory of the stiffness [bytes].
    integer(int64) :: stiffness_bytes = 0
    !> Floating-point operations of the factorization.
    real(dp) :: flops = 0
    !> Contact unknowns come last in the order of elimination, and responses go through the last block alone.
    logical :: is_condensed = .false.
    !> Responses go by the compliance as a matrix.
    logical :: is_explicit = .false.
    !> Entries that a response goes through.
    integer(int64) :: response_entries = 0
    !> Operations and entries in the order that is best without regard to contact.
    real(dp) :: whole_flops = 0
    integer(int64) :: whole_entries = 0
  end type factor_size_t

  public :: analyze_bodies, attach_bodies, check_memory, factorize_bodies

  !> Steps that schemes take which ask for one response in each.
  integer, parameter :: typical_steps = 300

contains

  !> Order and analyse the first bodies of all kinds, side by side.
  subroutine analyze_bodies(body, classes, block, form, single_solves, response, size_of, error)
    !> Assembled (n_bodies); without the graph of their nodes on return.
    type(body_t), intent(inout) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    !> Where they may touch (n_bodies).
    type(contact_block_t), intent(in) :: block(:)
    !> Form of the responses, one of `form_*` of dotyk_response_full.
    integer, intent(in) :: form
    !> Whether a scheme solves once in each of many steps, not for one contact point after the other.
    logical, intent(in) :: single_solves
    !> Analysed on return (n_bodies).
    type(response_slot_t), allocatable, intent(out) :: response(:)
    !> Sizes of the factors to come (n_bodies).
    type(factor_size_t), allocatable, intent(out) :: size_of(:)
    type(error_t), allocatable, intent(out) :: error
    type(error_slot_t), allocatable :: failed(:)
    integer, allocatable :: node(:)
    integer :: i, b, n_points, order(size(body))
    allocate (response(size(body)), size_of(size(body)), failed(size(body)))
    order = largest_first(real(body%constraint%n_equations, dp))
    !$omp parallel do default(none) shared(body, classes, block, form, single_solves, response, size_of, failed, order) &
    !$omp& private(b, node, n_points) schedule(dynamic, 1)
    do i = 1, size(body)
      b = order(i)
      if (interrupted()) cycle
      if (.not. classes%is_representative(b)) cycle
      call classes%contact_nodes(b, block, node, n_points)
      call analyze_body(body(b), node, n_points, count(classes%first == b), form, single_solves, response(b), size_of(b), &
                        failed(b)%error)
    end do
    !$omp end parallel do
    call stop_if_interrupted(error)
    if (.not. allocated(error)) call collect(body, failed, error)
    if (allocated(error)) return
    do b = 1, size(body)
      if (classes%is_representative(b)) cycle
      call share_response(response(classes%first(b)), size_of(classes%first(b)), response(b), size_of(b))
    end do
  end subroutine analyze_bodies

  !> Order and analyse the first body of a kind.
  subroutine analyze_body(body, contact_node, n_points, n_bodies, form, single_solves, slot, size_of, error)
    type(body_t), intent(inout) :: body
    !> Nodes where any body of the kind may touch, and the contact points of all of them.
    integer, intent(in) :: contact_node(:), n_points
    !> Bodies of the kind.
    integer, intent(in) :: n_bodies
    integer, intent(in) :: form
    logical, intent(in) :: single_solves
    type(response_slot_t), intent(inout) :: slot
    type(factor_size_t), intent(out) :: size_of
    type(error_t), allocatable, intent(out) :: error
    type(full_response_t), allocatable :: full
    allocate (full)
    call set_item("body '"//body%name//"'")
    call full%prepare(body, error, contact_node, form, &
                      response_demand_t(n_points, n_bodies, merge(typical_steps, 0, single_solves)))
    if (allocated(error)) return
    size_of%is_condensed = full%is_condensed
    size_of%is_explicit = full%is_explicit
    size_of%entries = full%factor%factor_entries
    size_of%bytes = full%factor%factor_bytes
    size_of%flops = full%factor%flops
    size_of%response_entries = full%response_entries()
    if (size_of%is_explicit) size_of%response_entries = (int(n_points, int64)/n_bodies)**2/2
    size_of%whole_flops = full%whole_flops
    size_of%whole_entries = full%whole_entries
    size_of%stiffness_bytes = 16*size(body%stiffness%row, kind=int64)
    call move_alloc(full, slot%form)
    deallocate (body%graph_start, body%graph_neighbour)
    call set_item('')
  end subroutine analyze_body

  !> The response of another body of the same kind.
  subroutine share_response(first, size_of_first, slot, size_of)
    type(response_slot_t), intent(in) :: first
    type(factor_size_t), intent(in) :: size_of_first
    type(response_slot_t), intent(inout) :: slot
    type(factor_size_t), intent(out) :: size_of
    type(full_response_t), allocatable :: full
    allocate (full)
    select type (form => first%form)
    type is (full_response_t)
      call full%share(form)
    end select
    call move_alloc(full, slot%form)
    size_of%is_condensed = size_of_first%is_condensed
    size_of%is_explicit = size_of_first%is_explicit
    size_of%response_entries = size_of_first%response_entries
    size_of%whole_entries = size_of_first%whole_entries
  end subroutine share_response

  !> Say where contact forces act on the bodies: before the factorization, which takes the stiffnesses away.
  subroutine attach_bodies(body, classes, block, response)
    !> Assembled (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    !> Where they may touch (n_bodies).
    type(contact_block_t), intent(in) :: block(:)
    !> Analysed (n_bodies).
    type(response_slot_t), intent(inout) :: response(:)
    integer :: b
    do b = 1, size(body)
      select type (full => response(b)%form)
      type is (full_response_t)
        call full%attach(body(b), block(b)%contact_node, body(classes%first(b)))
      end select
    end do
  end subroutine attach_bodies

  !> Refuse what plainly cannot be: factors that are larger than all memory that is left; warn where it will be scarce.
  subroutine check_memory(size_of, log, error)
    type(factor_size_t), intent(in) :: size_of(:)
    type(log_t), intent(inout) :: log
    type(error_t), allocatable, intent(out) :: error
    !> What a run takes beside the factors, as a part of them.
    real(dp), parameter :: beside = 0.15_dp
    type(memory_t) :: memory
    real(dp) :: factors, stiffnesses
    memory = memory_now()
    if (.not. memory%is_known) return
    factors = real(sum(size_of%bytes), dp)
    ! They are given back on the way.
    stiffnesses = real(sum(size_of%stiffness_bytes), dp)
    if (factors - stiffnesses > memory%left) then
      call set_error(error, 'not enough memory: the factors of the bodies take '//memory_text(factors)//', and '// &
        memory_text(memory%left)//' are left '//memory%limit//' (in use: '//memory_text(memory%used)// &
        '); nothing was solved: give it more memory, or take a coarser mesh or elements of first order', exit_machine)
    else if ((1 + beside)*factors - stiffnesses > memory%left) then
      call log%line('  warning: memory is scarce: the factors take '//memory_text(factors)//', and '//memory_text(memory%left)// &
                    ' are left '//memory%limit)
    end if
  end subroutine check_memory

  !> Factorize the first bodies of all kinds, the largest first: as many side by side as there are threads, and threads that no
  !> body is left for help the others with theirs. Their stiffnesses are given back one by one. The digits are the same on any
  !> number of threads.
  subroutine factorize_bodies(body, classes, block, take_apart, response, size_of, error)
    !> Assembled (n_bodies); without stiffness on return.
    type(body_t), intent(inout) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    !> Where they may touch (n_bodies).
    type(contact_block_t), intent(in) :: block(:)
    !> Whether the scheme can treat soft motions apart.
    logical, intent(in) :: take_apart
    !> Analysed (n_bodies).
    type(response_slot_t), intent(inout) :: response(:)
    !> Sizes of the factors (n_bodies).
    type(factor_size_t), intent(in) :: size_of(:)
    type(error_t), allocatable, intent(out) :: error
    type(error_slot_t), allocatable :: failed(:)
    integer :: i, b, order(size(body))
    allocate (failed(size(body)))
    order = largest_first(size_of%flops)
    call set_blas_threads(1)
    !$omp parallel default(none) shared(body, classes, take_apart, response, failed, order) private(i, b)
    !$omp single
    do i = 1, size(body)
      b = order(i)
      if (interrupted()) cycle
      if (.not. classes%is_representative(b)) cycle
      !$omp task default(none) shared(body, take_apart, response, failed) firstprivate(b)
      call factorize_body(body(b), take_apart, response(b), failed(b)%error)
      !$omp end task
    end do
    !$omp end single
    !$omp end parallel
    call stop_if_interrupted(error)
    if (.not. allocated(error)) call collect(body, failed, error)
    if (allocated(error)) return
    do b = 1, size(body)
      if (.not. classes%is_representative(b)) call share_condensed(response(classes%first(b)), response(b))
      call adopt_near_null_modes(response(classes%first(b)), block(b), response(b), body(b), error)
      if (allocated(error)) return
    end do
  end subroutine factorize_bodies

  !> Take what the first body's response has after its factorization.
  subroutine share_condensed(first, slot)
    type(response_slot_t), intent(in) :: first
    type(response_slot_t), intent(inout) :: slot
    select type (owner => first%form)
    type is (full_response_t)
      select type (full => slot%form)
      type is (full_response_t)
        call full%share_condensed(owner)
      end select
    end select
  end subroutine share_condensed

  !> Take the soft motions of the first body of the kind, if it has any.
  subroutine adopt_near_null_modes(first, block, slot, body, error)
    type(response_slot_t), intent(in) :: first
    type(contact_block_t), intent(in) :: block
    type(response_slot_t), intent(inout) :: slot
    type(body_t), intent(inout) :: body
    type(error_t), allocatable, intent(out) :: error
    type(digits_t) :: digits
    real(dp), allocatable :: at_rows(:, :)
    integer :: k
    select type (owner => first%form)
    type is (full_response_t)
      if (.not. allocated(owner%digits%motion)) return
      digits = owner%digits
    end select
    select type (full => slot%form)
    type is (full_response_t)
      call full%adopt_near_null_modes(digits)
      allocate (at_rows(size(block%row), full%n_motions))
      do k = 1, full%n_motions
        if (size(block%row) > 0) call block%matrix%multiply(full%motion(:, k), at_rows(:, k))
      end do
      call tell_apart(at_rows, digits%motion, digits%stiffness, error)
      if (allocated(error)) return
      call full%adopt_near_null_modes(digits)
    end select
    call body%adopt_near_null_modes(digits%motion)
  end subroutine adopt_near_null_modes

  !> Factorize one body.
  subroutine factorize_body(body, take_apart, slot, error)
    type(body_t), intent(inout) :: body
    logical, intent(in) :: take_apart
    type(response_slot_t), intent(inout) :: slot
    type(error_t), allocatable, intent(out) :: error
    select type (full => slot%form)
    type is (full_response_t)
      call set_item("body '"//body%name//"'")
      call full%factorize(body, error, take_apart)
      call set_item('')
    end select
  end subroutine factorize_body

  !> All bodies' errors as one.
  subroutine collect(body, failed, error)
    type(body_t), intent(in) :: body(:)
    type(error_slot_t), intent(inout) :: failed(:)
    type(error_t), allocatable, intent(out) :: error
    type(problem_list_t) :: problems
    integer :: b
    do b = 1, size(body)
      call problems%add_error(failed(b)%error, "body '"//body(b)%name//"': ")
    end do
    call problems%raise(error)
  end subroutine collect
end module dotyk_driver_factorization
