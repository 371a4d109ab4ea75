!> Reads the quantities of `&output` and `&accuracy` from checked groups.
module dotyk_input_quantities
  use dotyk_base_options, only: option_name, quantity_force, quantity_names, quantity_reaction
  use dotyk_base_text, only: shown, text_t
  use dotyk_input_case, only: quantity_input_t
  use dotyk_input_groups, only: group_t
  use dotyk_input_references, only: input_t, names_several
  implicit none
  private
  public :: read_quantities

contains

  !> Append the quantities of a group.
  subroutine read_quantities(group, input, is_goal, quantity)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    logical, intent(in) :: is_goal  !! Whether meshes are made for them.
    type(quantity_input_t), allocatable, intent(inout) :: quantity(:)  !! The quantities (n).
    type(text_t), allocatable :: texts(:)
    type(quantity_input_t) :: new
    integer :: i
    logical :: is_known
    call group%texts_of('quantity', texts)
    do i = 1, size(texts)
      call read_one(group, input, texts(i)%s, new, is_known)
      new%is_goal = is_goal
      if (is_known) quantity = [quantity, new]
    end do
  end subroutine read_quantities

  !> Read one of them.
  subroutine read_one(group, input, text, quantity, is_known)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: text  !! The text.
    type(quantity_input_t), intent(out) :: quantity  !! The quantity.
    logical, intent(out) :: is_known  !! Whether it is one.
    character(:), allocatable :: kind, place
    integer, allocatable :: matched(:)
    integer :: blank, colon, k
    is_known = .false.
    quantity%line = group%line
    quantity%text = text
    colon = index(text, ':')
    kind = ''
    if (colon > 0) kind = trim(adjustl(text(:colon - 1)))
    quantity%kind = findloc([(option_name(quantity_names, k) == kind, k=1, quantity_reaction)], .true., 1)
    place = trim(adjustl(text(colon + 1:)))
    if (quantity%kind == quantity_force) then
      quantity%name = place
      is_known = len(place) > 0
    else if (quantity%kind > 0) then
      colon = index(place, ':')
      blank = index(place, ' ', back=.true.)
      if (colon > 1 .and. blank > colon + 1 .and. blank + 1 == len(place)) then
        quantity%name = trim(place(:colon - 1))
        quantity%surface = trim(adjustl(place(colon + 1:blank)))
        quantity%axis = index('xyz', place(blank + 1:))
        is_known = quantity%axis > 0 .and. (quantity%axis <= input%scene%dimension .or. &
          input%scene%dimension == 0) .and. len(quantity%surface) > 0
      end if
    end if
    if (.not. is_known) then
      call input%report(group, 'quantity', 'quantity: '//shown(text)//' is none of ''force:NAME OF A CONTACT '// &
                        'PAIR'', ''force:BODY - BODY'', ''displacement:BODY:SURFACE x'', ''reaction:BODY:SURFACE '// &
                        'x'', x an axis of the scene')
      return
    end if
    if (quantity%kind == quantity_force) return
    call input%refer_to_bodies(group, 'quantity', quantity%name, matched)
    quantity%any_body = names_several(quantity%name, input%bodies)
    is_known = size(matched) > 0
    quantity%body = matched
  end subroutine read_one
end module dotyk_input_quantities
