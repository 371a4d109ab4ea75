!> Congruence classes of bodies that are dealt out to the ranks.
!>
!> They are those that one process finds: bodies are compared in the same order, each by its own rank, which reads the
!> representative, too, where it may be congruent.
module dotyk_model_dealt_classes
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_parcel, only: parcel_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_congruence, only: are_congruent, congruence_invariants_t
  use dotyk_elasticity_load_cases, only: adopt_congruent_body
  use dotyk_input_case, only: case_t
  use dotyk_mesh_placement, only: placement_t
  use dotyk_model_chosen_bodies, only: chosen_bodies_t
  use dotyk_model_mesh_survey, only: mesh_survey_t
  use dotyk_ranks_exchange, only: by_owner, is_own, on_any_rank, share, share_parcel
  implicit none
  private
  public :: find_classes

contains

  !> Find the congruence classes. A rank that has bodies of a class has the representative, too, on return.
  subroutine find_classes(case, survey, owner, own, classes)
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_survey_t), intent(in) :: survey  !! What the mesh files have.
    integer, intent(in) :: owner(:)  !! Rank of each body (n_bodies).
    !> The bodies of this rank; those that are congruent to others get their equations and axes.
    type(chosen_bodies_t), intent(inout) :: own
    type(congruence_classes_t), intent(out) :: classes  !! The classes.
    type(congruence_invariants_t) :: invariants(size(owner))
    type(placement_t) :: motion(size(owner))
    logical, dimension(size(owner)) :: may_be, is_congruent, missing
    integer :: b, c
    call classes%init(size(owner))
    if (interrupted()) return
    call share_invariants(owner, own%body, invariants)
    do c = 1, size(owner)
      if (.not. classes%is_representative(c)) cycle
      may_be = [(b > c .and. classes%first(b) == b .and. invariants(c)%matches(invariants(b)), b=1, size(owner))]
      if (.not. any(may_be)) cycle
      missing = .false.
      missing(c) = any(may_be .and. is_own(owner)) .and. .not. own%has(c)
      if (on_any_rank(missing(c))) call own%build(case, survey, missing)
      if (on_any_rank(own%problems%count > 0)) return
      if (interrupted()) return
      is_congruent = .false.
      do b = c + 1, size(owner)
        if (.not. (may_be(b) .and. is_own(owner(b)))) cycle
        is_congruent(b) = are_congruent(own%body(c), invariants(c), own%body(b), invariants(b), motion(b))
        if (is_congruent(b)) call adopt_congruent_body(own%body(c), motion(b), own%body(b))
      end do
      call share(owner, is_congruent)
      call share_motions(owner, motion)
      do b = c + 1, size(owner)
        if (.not. is_congruent(b)) cycle
        classes%first(b) = c
        classes%motion(b) = motion(b)
      end do
    end do
  end subroutine find_classes

  !> Invariants of all bodies.
  subroutine share_invariants(owner, body, invariants)
    integer, intent(in) :: owner(:)  !! Rank of each body (n_bodies).
    type(body_t), intent(in) :: body(:)  !! Bodies, those of this rank built (n_bodies).
    type(congruence_invariants_t), intent(out) :: invariants(:)  !! Their invariants (n_bodies).
    type(parcel_t) :: parcel
    integer :: b, k, order(size(owner))
    do b = 1, size(owner)
      if (.not. is_own(owner(b))) cycle
      call invariants(b)%init(body(b))
      call invariants(b)%carry(parcel)
    end do
    call share_parcel(owner, parcel)
    if (parcel%at_end()) return
    order = by_owner(owner)
    do k = 1, size(order)
      call invariants(order(k))%carry(parcel)
    end do
  end subroutine share_invariants

  !> Motions of all bodies.
  subroutine share_motions(owner, motion)
    integer, intent(in) :: owner(:)  !! Rank of each body (n_bodies).
    type(placement_t), intent(inout) :: motion(:)  !! Those of the bodies of this rank in, of all out (n_bodies).
    type(parcel_t) :: parcel
    integer :: b, k, order(size(owner))
    do b = 1, size(owner)
      if (is_own(owner(b))) call motion(b)%carry(parcel)
    end do
    call share_parcel(owner, parcel)
    if (parcel%at_end()) return
    order = by_owner(owner)
    do k = 1, size(order)
      call motion(order(k))%carry(parcel)
    end do
  end subroutine share_motions
end module dotyk_model_dealt_classes
