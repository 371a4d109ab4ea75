!> The directory in which meshes of geometries are kept: `.dotyk/` beside the geometry, or the cache directory of the
!> user where that cannot be used. Meshes that others could have put there are not taken.
module dotyk_mesh_mesh_cache
  use dotyk_base_error, only: error_t, exit_not_written, set_error
  use dotyk_base_files, only: behind_links, is_trusted_folder, user_number, write_new
  use dotyk_base_operating_system, only: directory_of, environment_value, make_directory
  use dotyk_base_text, only: to_text
  implicit none
  private
  public :: find_cache

contains

  !> Directory for the meshes of a geometry; it is created if it does not exist.
  subroutine find_cache(geo_file, directory, error)
    character(*), intent(in) :: geo_file  !! Path of the geometry.
    character(:), allocatable, intent(out) :: directory  !! Path of the directory, with its slash.
    !> Set, with the exit code `exit_not_written`, if there is no directory that only this user, or the owner of the
    !> geometry, can write.
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: other, folder
    logical :: trusted
    integer :: i
    directory = directory_of(geo_file)//'.dotyk'
    call make_directory(directory)
    if (is_trusted_folder(directory, beside=geo_file)) then
      directory = directory//'/'
      ! The contents are not for version control.
      call write_new(directory//'.gitignore', '*'//new_line('a'))
      return
    end if
    call find_user_cache(other, trusted)
    if (.not. trusted) then
      call set_error(error, geo_file//': no directory for its mesh: neither '//directory//' nor '//other// &
                     ' can be written, or they belong to other users; set XDG_CACHE_HOME to a directory of your own', &
                     exit_not_written)
      return
    end if
    ! Meshes of other folders have the same names.
    folder = directory_of(geo_file)
    if (index(folder, '/') /= 1) folder = behind_links('/proc/self/cwd')//'/'//folder
    do i = 2, len(folder)
      if (folder(i:i) == '/') call make_directory(other//folder(:i))
    end do
    directory = other//folder
  end subroutine find_cache

  !> Cache directory of the user: in XDG_CACHE_HOME, in the home directory, or in the directory of temporary files,
  !> where everybody can make directories.
  subroutine find_user_cache(directory, trusted)
    character(:), allocatable, intent(out) :: directory  !! Path of the directory, without slash.
    logical, intent(out) :: trusted  !! Whether it can be used.
    character(:), allocatable :: cache, home
    cache = environment_value('XDG_CACHE_HOME')
    home = environment_value('HOME')
    if (len(cache) == 0 .and. len(home) > 0) cache = home//'/.cache'
    if (len(cache) > 0) then
      call make_directory(cache)
      directory = cache//'/dotyk'
      call make_directory(directory)
      trusted = is_trusted_folder(directory, beside=cache)
    else
      cache = environment_value('TMPDIR')
      if (len(cache) == 0) cache = '/tmp'
      directory = cache//'/dotyk-'//to_text(user_number())
      call make_directory(directory, private=.true.)
      trusted = is_trusted_folder(directory)
    end if
  end subroutine find_user_cache
end module dotyk_mesh_mesh_cache
