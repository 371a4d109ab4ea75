!> Files with the parts of the volumes of a case that ranks compute together, one for each rank: its elements with the
!> layers around them, their numbers in the whole volumes, their owners, and the surfaces that the case names.
!>
!> One process reads the meshes, builds the bodies with all checks, divides the elements and writes the files, before a
!> run (`--partition`) or at its start; then each rank reads its own. They are in the cache of meshes beside the case.
!> They begin with the names of all that they depend on, the volumes and surfaces that are asked for, and are made again
!> by the rule of make where a mesh is newer.
module dotyk_model_part_files
  use dotyk_base_error, only: error_t, exit_not_written, set_error
  use dotyk_base_files, only: own_mark, remove_leftovers
  use dotyk_base_interrupt, only: run_command
  use dotyk_base_kinds, only: int64
  use dotyk_base_operating_system, only: remove_file, rename_file, shell_quoted
  use dotyk_base_options, only: analysis_3d, response_multigrid
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t, to_text
  use dotyk_base_version, only: version
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_element_ranks, only: element_work, rank_elements
  use dotyk_elasticity_shortest_extent, only: shortest_extent
  use dotyk_input_case, only: case_t
  use dotyk_mesh_held_part, only: describe_whole
  use dotyk_mesh_mesh_cache, only: find_cache
  use dotyk_mesh_body_mesh, only: whole_body_t
  use dotyk_model_body_setup, only: build_bodies
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_model_materials, only: would_lock
  use dotyk_model_mesh_file, only: find_msh
  use dotyk_model_volumes, only: volume_t
  implicit none
  private

  type, public :: part_files_t  !! The files of a case.
    integer :: n = 0  !! Number of parts.
    character(:), allocatable :: path  !! Path of the files, up to the number of the part.
    character(:), allocatable, private :: key  !! Names of what they depend on.
    !> Mark of the process that has made them, and when: all ranks read the same parts (`mark_length` letters).
    character(:), allocatable, private :: mark
    type(text_t), allocatable :: remark(:)  !! What the log is to say of the bodies (n_remarks).
    type(volume_t), allocatable :: volume(:)  !! The part of one rank of the volumes, those of first bodies (n_bodies).
    logical :: are_made = .false.  !! Whether the files were made now.
  contains
    procedure :: provide => files_provide
    procedure :: read => files_read
    procedure :: carry => files_carry
  end type part_files_t

  integer, parameter :: mark_length = 128  !! Letters of a mark.

contains

  !> Find the files of a case, or make them.
  subroutine files_provide(self, case, n_parts, fewest_unknowns, are_of_use, error)
    class(part_files_t), intent(out) :: self
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: n_parts  !! Number of ranks that compute the bodies together.
    integer, intent(in) :: fewest_unknowns  !! Unknowns of the largest body from which on bodies are split.
    logical, intent(out) :: are_of_use  !! Not where all bodies are small; there are no files then.
    !> Allocated where meshes or bodies are wrong, as one process finds it, or files cannot be written.
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: directory, meshes, msh
    character(mark_length) :: mark
    integer :: b, r
    are_of_use = .false.
    self%n = n_parts
    call find_cache(case%file, directory, error)
    if (allocated(error)) return
    self%path = directory//case%file(index(case%file, '/', back=.true.) + 1:)//'.'//to_text(n_parts)//'-'
    call find_key(self, case)
    meshes = ''
    do b = 1, size(case%body)
      if (any([(case%body(r)%mesh == case%body(b)%mesh, r=1, b - 1)])) cycle
      call find_msh(case, case%body(b)%mesh, msh, error)
      ! Who builds the bodies finds all mistakes.
      if (allocated(error)) exit
      if (index(msh, '-') == 1) msh = './'//msh
      meshes = meshes//' '//shell_quoted(msh)
    end do
    call read_mark(self, 0, mark)
    self%mark = mark
    do r = 0, n_parts - 1
      if (.not. is_current(self, r)) exit
    end do
    if (r == n_parts .and. .not. allocated(error)) &
      are_of_use = run_command('test -z "$(find -L'//meshes//' -prune "(" -newer '//oldest()//' -o -cnewer '// &
                               oldest()//' ")" 2>&1)"') == 0
    if (.not. are_of_use) call make(self, case, fewest_unknowns, are_of_use, error)

  contains

    !> The file that was written first, as a word of the shell.
    function oldest() result(word)
      character(:), allocatable :: word
      word = shell_quoted(file_of(self, 0))
    end function oldest
  end subroutine files_provide

  !> The names of what the files depend on.
  subroutine find_key(self, case)
    type(part_files_t), intent(inout) :: self  !! The files; get their key.
    type(case_t), intent(in) :: case  !! The case.
    integer :: b, k
    self%key = version//' '//to_text(self%n)
    call add('scene', [case%scene%dimension, case%scene%analysis, case%scene%mesh_order])
    self%key = self%key//to_text(case%scene%mesh_size, 17)
    do b = 1, size(case%body)
      associate (body => case%body(b))
        do k = 1, size(body%volumes)
          call add(body%volumes(k)%s, [body%material_of(k)])
        end do
        call add(body%mesh, [b, merge(1, 0, would_lock(case, b)), merge(1, 0, body%is_surface), &
                             merge(1, 0, body%cut%is_cut())])
      end associate
    end do
    do k = 1, size(case%contact)
      associate (contact => case%contact(k))
        if (contact%auto) cycle
        if (contact%searched) then
          call add(contact%surface_a, contact%bodies_a)
          call add(contact%surface_b, contact%bodies_b)
        else
          call add(contact%surface_a, [contact%body_a])
          call add(contact%surface_b, [contact%body_b])
        end if
      end associate
    end do
    do k = 1, size(case%support)
      call add(case%support(k)%place%text(case%scene%dimension), [case%support(k)%body])
    end do
    do k = 1, size(case%load)
      call add(case%load(k)%place%text(case%scene%dimension), [case%load(k)%body])
    end do

  contains

    !> Add a name and numbers.
    subroutine add(name, number)
      character(*), intent(in) :: name  !! The name.
      integer, intent(in) :: number(:)  !! The numbers (n).
      integer :: i
      self%key = self%key//new_line('a')//name
      do i = 1, size(number)
        self%key = self%key//' '//to_text(number(i))
      end do
    end subroutine add
  end subroutine find_key

  !> Make the files.
  subroutine make(self, case, fewest_unknowns, are_of_use, error)
    type(part_files_t), intent(inout) :: self  !! The files.
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: fewest_unknowns  !! As in `provide`.
    logical, intent(out) :: are_of_use  !! As in `provide`.
    type(error_t), allocatable, intent(out) :: error  !! As in `provide`.
    type(body_t), allocatable :: body(:)
    type(body_surfaces_t), allocatable :: surfaces(:)
    type(volume_t), allocatable :: volume(:)
    integer :: b, count
    allocate (volume(size(case%body)))
    call build_bodies(case, body, surfaces, self%remark, error, kept=volume)
    are_of_use = .false.
    if (allocated(error)) return
    are_of_use = case%solver%response == response_multigrid
    if (case%scene%analysis == analysis_3d) &
      are_of_use = are_of_use .or. any([(body(b)%n_unknowns() >= fewest_unknowns, b=1, size(body))])
    deallocate (body, surfaces)
    if (.not. are_of_use) return
    call system_clock(count)
    self%mark = own_mark()//' '//to_text(count)
    self%mark = self%mark//repeat(' ', max(0, mark_length - len(self%mark)))
    self%mark = self%mark(:mark_length)
    call write_parts(self, volume, error)
    self%are_made = .not. allocated(error)
  end subroutine make

  !> Divide the volumes, and write the parts.
  subroutine write_parts(self, volume, error)
    type(part_files_t), intent(in) :: self  !! The files.
    type(volume_t), intent(inout) :: volume(:)  !! Volumes, those of first bodies (n_bodies).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where there is no memory, or no room on the disk.
    type :: rank_list_t
      integer, allocatable :: of(:)  !! Rank of each element (n_elements).
    end type rank_list_t
    type(rank_list_t) :: rank(size(volume))
    type(whole_body_t) :: whole(size(volume))
    type(part_files_t) :: part
    integer(int64) :: work, before
    integer :: b, r
    work = 0
    do b = 1, size(volume)
      if (volume(b)%n_bodies > 0) work = work + volume(b)%n_bodies*element_work(volume(b)%mesh)
    end do
    before = 0
    do b = 1, size(volume)
      if (volume(b)%n_bodies == 0) cycle
      call rank_elements(volume(b)%mesh, volume(b)%n_bodies, before, work, self%n, rank(b)%of, error)
      if (allocated(error)) return
      before = before + volume(b)%n_bodies*element_work(volume(b)%mesh)
      call describe_whole(volume(b)%mesh, shortest_extent(volume(b)%mesh), whole(b))
    end do
    do r = 0, self%n - 1
      part = self
      part%volume = volume
      do b = 1, size(volume)
        if (volume(b)%n_bodies > 0) call part%volume(b)%hold(whole(b), rank(b)%of, r)
      end do
      call write_part(part, r, error)
      if (allocated(error)) return
    end do
  end subroutine write_parts

  !> Write the part of one rank.
  subroutine write_part(part, rank, error)
    type(part_files_t), intent(inout) :: part  !! The files, with the volumes of this rank.
    integer, intent(in) :: rank  !! The rank, from 0.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    type(parcel_t) :: parcel
    character(:), allocatable :: path, temporary
    integer :: unit, status, closed
    logical :: is_written
    call part%carry(parcel)
    path = file_of(part, rank)
    call remove_leftovers(path)
    temporary = path//own_mark()
    open (newunit=unit, file=temporary, access='stream', form='unformatted', action='write', status='replace', &
          iostat=status)
    is_written = status == 0
    if (is_written) then
      write (unit, iostat=status) part%mark, len(part%key), parcel%n_words(), part%key
      if (status == 0) write (unit, iostat=status) parcel%words()
      close (unit, iostat=closed)
      is_written = status == 0 .and. closed == 0
    end if
    if (is_written) is_written = rename_file(temporary, path)
    if (is_written) return
    call remove_file(temporary)
    call set_error(error, path//': the parts of the meshes cannot be written', exit_not_written)
  end subroutine write_part

  !> Path of the part of one rank.
  function file_of(self, rank) result(path)
    type(part_files_t), intent(in) :: self  !! The files.
    integer, intent(in) :: rank  !! The rank, from 0.
    character(:), allocatable :: path
    path = self%path//to_text(rank + 1)//'.part'
  end function file_of

  !> The mark of the file of one rank.
  subroutine read_mark(self, rank, mark)
    type(part_files_t), intent(in) :: self  !! The files.
    integer, intent(in) :: rank  !! The rank, from 0.
    character(mark_length), intent(out) :: mark  !! The mark; blank where there is no file.
    integer :: unit, status
    mark = ''
    open (newunit=unit, file=file_of(self, rank), access='stream', form='unformatted', action='read', status='old', &
          iostat=status)
    if (status /= 0) return
    read (unit, iostat=status) mark
    if (status /= 0) mark = ''
    close (unit)
  end subroutine read_mark

  !> Whether there is a file of one rank that is whole and has the mark and the key.
  logical function is_current(self, rank)
    type(part_files_t), intent(in) :: self  !! The files.
    integer, intent(in) :: rank  !! The rank, from 0.
    integer(int64) :: n_words
    integer :: unit
    call open_part(self, rank, unit, n_words)
    is_current = n_words > 0
    if (is_current) close (unit)
  end function is_current

  !> Open the file of one rank.
  subroutine open_part(self, rank, unit, n_words)
    type(part_files_t), intent(in) :: self  !! The files.
    integer, intent(in) :: rank  !! The rank, from 0.
    integer, intent(out) :: unit  !! Unit, before the words; of no meaning where there are none.
    !> Number of words of the file; 0 where there is none that is whole and has the mark and the key.
    integer(int64), intent(out) :: n_words
    character(mark_length) :: mark
    character(len(self%key)) :: key
    integer(int64) :: n_bytes, first
    integer :: length, status
    n_words = 0
    open (newunit=unit, file=file_of(self, rank), access='stream', form='unformatted', action='read', status='old', &
          iostat=status)
    if (status /= 0) return
    read (unit, iostat=status) mark, length, n_words
    if (status == 0) status = merge(0, 1, mark == self%mark .and. length == len(key))
    if (status == 0) read (unit, iostat=status) key
    if (status == 0) then
      inquire (unit=unit, size=n_bytes, pos=first)
      status = merge(0, 1, key == self%key .and. n_bytes == first - 1 + 8*n_words)
    end if
    if (status == 0) return
    n_words = 0
    close (unit)
  end subroutine open_part

  !> Read the part of one rank.
  subroutine files_read(self, rank, error)
    class(part_files_t), intent(inout) :: self
    integer, intent(in) :: rank  !! The rank, from 0.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where its file cannot be read, or is of another run.
    type(parcel_t) :: parcel
    integer(int64), allocatable :: word(:)
    integer(int64) :: n_words
    integer :: unit, status
    call open_part(self, rank, unit, n_words)
    status = 1
    if (n_words > 0) then
      allocate (word(n_words))
      read (unit, iostat=status) word
      close (unit)
    end if
    if (status /= 0) then
      call set_error(error, file_of(self, rank)//': the part of rank '//to_text(rank)//' cannot be read, or '// &
                     'another run has replaced it: all ranks need the same file system; run the case again')
      return
    end if
    call parcel%open(word)
    call self%carry(parcel)
  end subroutine files_read

  !> Put it into a parcel, or take it out.
  subroutine files_carry(self, parcel)
    class(part_files_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    integer :: b, n
    call parcel%carry(self%n)
    call parcel%carry(self%path)
    call parcel%carry(self%key)
    call parcel%carry(self%mark)
    call parcel%carry(self%remark)
    call parcel%carry(self%are_made)
    n = 0
    if (allocated(self%volume)) n = size(self%volume)
    call parcel%carry(n)
    if (parcel%is_read .and. n > 0) then
      if (allocated(self%volume)) deallocate (self%volume)
      allocate (self%volume(n))
    end if
    do b = 1, n
      call self%volume(b)%carry(parcel)
    end do
  end subroutine files_carry
end module dotyk_model_part_files
