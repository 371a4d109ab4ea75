!> Reads the quantities of `&output` and `&accuracy` from checked groups.
module dotyk_input_quantities
  use dotyk_base_options, only: last_linear_quantity, option_name, quantity_displacement, quantity_mises, &
    quantity_names, quantity_of_pair, quantity_reaction, quantity_travel
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
    quantity%surface = ''
    colon = index(text, ':')
    kind = ''
    if (colon > 0) kind = trim(adjustl(text(:colon - 1)))
    quantity%kind = findloc([(option_name(quantity_names, k) == kind, k=1, quantity_mises)], .true., 1)
    place = trim(adjustl(text(colon + 1:)))
    if (quantity_of_pair(quantity%kind)) then
      quantity%name = place
      is_known = len(place) > 0
    else if (quantity%kind > 0) then
      blank = index(place, ' ', back=.true.)
      colon = index(place, ':')
      if (any(quantity%kind == [quantity_displacement, quantity_reaction]) .and. blank > colon + 1 .and. &
          colon > 0 .and. blank + 1 == len(place)) then
        quantity%axis = index('xyz', place(blank + 1:))
        if (quantity%axis > 0) place = trim(place(:blank))
      end if
      if (quantity%kind == quantity_displacement .and. quantity%axis == 0) quantity%kind = quantity_travel
      quantity%name = place
      if (colon > 0) then
        quantity%name = trim(place(:colon - 1))
        quantity%surface = trim(adjustl(place(colon + 1:)))
      end if
      is_known = len(quantity%name) > 0 .and. (colon == 0 .or. len(quantity%surface) > 0) .and. &
        (quantity%axis > 0 .eqv. quantity%kind <= last_linear_quantity) .and. &
        (quantity%axis <= input%scene%dimension .or. input%scene%dimension == 0)
    end if
    if (.not. is_known) then
      call input%report(group, 'quantity', 'quantity: '//shown(text)//' is none of ''KIND:NAME OF A CONTACT '// &
                        'PAIR'' or ''KIND:BODY - BODY'' of the kinds force, mean_pressure, peak, area; '// &
                        '''displacement:BODY:SURFACE x'', ''reaction:BODY:SURFACE x'', x an axis of the scene; '// &
                        '''displacement:BODY'', ''displacement:BODY:SURFACE'', ''mises:BODY'', '// &
                        '''mises:BODY:SURFACE''')
      return
    end if
    if (quantity_of_pair(quantity%kind)) return
    call input%refer_to_bodies(group, 'quantity', quantity%name, matched)
    quantity%any_body = names_several(quantity%name, input%bodies)
    is_known = size(matched) > 0
    quantity%body = matched
  end subroutine read_one
end module dotyk_input_quantities
