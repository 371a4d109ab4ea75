!> What the schemes get of the bodies: the modes that they solve for, and the compliance operators.
module dotyk_control_body_operators
  use dotyk_base_error, only: error_slot_t, error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_factorization, only: factor_size_t
  use dotyk_control_response_choice, only: operator_slot_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: item_t, share, share_errors
  use dotyk_response_near_null_modes, only: separate_by_contact
  use dotyk_response_response, only: response_slot_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use dotyk_scheme_body_compliance, only: body_operator_t
  use dotyk_scheme_coarse_space, only: contact_modes_t
  implicit none
  private
  public :: find_modes, make_operators

contains

  !> The modes that the scheme solves for: near-null-space modes where the factorization found them, rigid body modes
  !> elsewhere.
  subroutine find_modes(body, classes, ranks, block, report, modes, at_contact, error)
    type(body_t), intent(in) :: body(:)  !! Assembled (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Classes of congruent bodies.
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B (n_bodies).
    type(factorization_report_t), intent(in) :: report(:)  !! Reports of the representatives (n_bodies).
    !> Rigid body modes; those that are near-null-space modes are replaced (n_bodies).
    type(body_modes_t), intent(inout) :: modes(:)
    type(contact_modes_t), allocatable, intent(out) :: at_contact(:)  !! The modes at the contact nodes (n_bodies).
    !> Allocated where a mode at the contact rows is not finite, or LAPACK's singular value decomposition does not
    !> converge.
    type(error_t), allocatable, intent(out) :: error
    type(item_t) :: item(size(body))
    type(error_slot_t) :: failed(size(body))
    integer :: b
    allocate (at_contact(size(body)))
    do b = 1, size(body)
      associate (of_class => report(classes%first(b)))
        if (of_class%n_near_null == 0 .or. .not. ranks%is_own(b)) cycle
        call take_near_null(body(b), block(b), of_class, modes(b), failed(b)%error)
        if (n_ranks() > 1 .and. .not. allocated(failed(b)%error)) &
          call modes(b)%pack_near_null(body(b)%shared_node, item(b)%value)
      end associate
    end do
    call share_errors(ranks%owner, failed)
    do b = 1, size(body)
      if (.not. allocated(failed(b)%error)) cycle
      call move_alloc(failed(b)%error, error)
      return
    end do
    call share(ranks%owner, item)
    do b = 1, size(body)
      if (.not. ranks%is_own(b) .and. report(classes%first(b))%n_near_null > 0) &
        call modes(b)%unpack_near_null(body(b)%mesh%n_nodes(), body(b)%shared_node, item(b)%value)
      at_contact(b)%displacement = reshape(modes(b)%shape(:, block(b)%contact_node, :), &
                                           [size(modes(b)%shape, 1)*size(block(b)%contact_node), modes(b)%n])
      at_contact(b)%resultant = modes(b)%resultant
      at_contact(b)%resultant_size = modes(b)%resultant_size
      at_contact(b)%mean_square = 1.0_dp/max(1, body(b)%mesh%n_whole_nodes())
      if (.not. modes(b)%is_near_null()) then
        at_contact(b)%translation = modes(b)%rigid%translations()
        cycle
      end if
      at_contact(b)%stiffness = modes(b)%stiffness
      at_contact(b)%lift_resultant = modes(b)%lift_resultant
    end do
  end subroutine find_modes

  !> The near-null-space modes of one body, separated by what its contact rows feel.
  subroutine take_near_null(body, block, report, modes, error)
    type(body_t), intent(in) :: body  !! The body, assembled.
    type(contact_block_t), intent(in) :: block  !! Its rows of B.
    type(factorization_report_t), intent(in) :: report  !! Report of the representative.
    type(body_modes_t), intent(inout) :: modes  !! Replaced by the near-null-space modes.
    type(error_t), allocatable, intent(out) :: error  !! As in `find_modes`.
    real(dp), allocatable :: mode(:, :), stiffness(:, :), at_rows(:, :), u(:, :)
    integer :: k
    allocate (mode, mold=report%near_null)
    mode = report%near_null
    stiffness = report%near_null_stiffness
    allocate (at_rows(size(block%row), size(mode, 2)), u(body%dimension, body%mesh%n_nodes()))
    do k = 1, size(mode, 2)
      if (size(block%row) == 0) cycle
      call body%constraint%expand(mode(:, k), u, .false.)
      call block%matrix%multiply(reshape(u(:, block%contact_node), [body%dimension*size(block%contact_node)]), &
                                 at_rows(:, k))
    end do
    call separate_by_contact(at_rows, mode, stiffness, error)
    if (.not. allocated(error)) call modes%take_near_null(body, mode, stiffness)
  end subroutine take_near_null

  !> What the compliance of all bodies is made of.
  subroutine make_operators(body, classes, ranks, block, report, size_of, slot, response, operators)
    type(body_t), intent(in) :: body(:)  !! Assembled (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Classes of congruent bodies.
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B (n_bodies).
    type(factorization_report_t), intent(in) :: report(:)  !! Reports of the representatives (n_bodies).
    type(factor_size_t), intent(in) :: size_of(:)  !! Sizes of the factors (n_bodies).
    type(operator_slot_t), intent(inout) :: slot(:)  !! Factorized; empty on return (n_bodies).
    !> Compliance operators of the representatives (n_bodies).
    type(response_slot_t), allocatable, intent(out) :: response(:)
    !> Parts of the compliance that belong to each body (n_bodies).
    type(body_operator_t), allocatable, intent(out) :: operators(:)
    type(item_t) :: diagonal(size(body))
    integer :: b
    allocate (response(size(body)), operators(size(body)))
    do b = 1, size(body)
      if (allocated(slot(b)%direct)) call move_alloc(slot(b)%direct, response(b)%form)
      if (allocated(slot(b)%multigrid)) call move_alloc(slot(b)%multigrid, response(b)%form)
      associate (own => operators(b), d => body(b)%dimension)
        own%representative = classes%first(b)
        own%rotation = classes%motion(b)%rotation(:d, :d)
        call own%map%init(body(b)%constraint, block(b)%contact_node)
        if (ranks%is_own(b)) diagonal(b)%value = own%map%diagonal(report(classes%first(b))%diagonal)
        own%cost = real(size_of(b)%product_entries, dp)
        own%owner = ranks%owner(b)
      end associate
    end do
    call share(ranks%owner, diagonal)
    do b = 1, size(body)
      call move_alloc(diagonal(b)%value, operators(b)%nodal_stiffness)
    end do
  end subroutine make_operators
end module dotyk_control_body_operators
