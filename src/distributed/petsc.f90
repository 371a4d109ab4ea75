!> PETSc over MPI: its begin and end, its error codes as errors, and sums over ranks.
!>
!> All ranks call the procedures of this layer together. Sums are the same to the bit on all ranks: what follows from
!> them - active sets, the end of an iteration - is so, too.
module dotyk_distributed_petsc
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_funloc, c_funptr, c_int, c_null_ptr, &
    c_ptr, c_size_t
  use mpi_f08, only: mpi_allreduce, mpi_comm_world, mpi_double_precision, mpi_exscan, mpi_in_place, mpi_integer, &
    mpi_max, mpi_sum
  use petscsys, only: PETSC_NULL_OPTIONS, PetscFinalize, PetscInitialize, PetscOptionsSetValue, &
    petsc_initialized => PetscInitialized
  use dotyk_base_error, only: error_t, exit_machine, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: print_error
  use dotyk_base_text, only: to_text
  use dotyk_ranks_communication, only: abort_ranks, n_ranks, this_rank
  implicit none
  private
  public :: first_of_rank, has_failed, largest_of_ranks, petsc_option, start_petsc, stop_petsc, sum_of_ranks

  !> Sum over the ranks, on all of them.
  interface sum_of_ranks
    module procedure sum_of_reals, sum_of_integers
  end interface sum_of_ranks

  interface
    !> Of PETSc, which has no Fortran procedure for it: take back the signals that it has taken.
    integer(c_int) function c_pop_signal_handler() bind(c, name='PetscPopSignalHandler')
      import :: c_int
    end function c_pop_signal_handler

    !> Of PETSc, likewise: call a procedure at errors.
    integer(c_int) function c_push_error_handler(handler, context) bind(c, name='PetscPushErrorHandler')
      import :: c_funptr, c_int, c_ptr
      type(c_funptr), value :: handler  !! The procedure.
      type(c_ptr), value :: context  !! What it gets.
    end function c_push_error_handler

    pure integer(c_size_t) function c_strlen(text) bind(c, name='strlen')
      import :: c_ptr, c_size_t
      type(c_ptr), value, intent(in) :: text  !! Text, ended by a null character.
    end function c_strlen
  end interface

contains

  !> Begin, unless it has begun; MPI begins with it.
  subroutine start_petsc(error)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc does not start.
    integer :: code
    logical :: is_running
    call petsc_initialized(is_running, code)
    if (is_running) return
    call PetscInitialize(code)
    if (has_failed(code, 'start', error)) return
    code = int(c_push_error_handler(c_funloc(end_at_error), c_null_ptr))
    if (has_failed(code, 'start', error)) return
    ! Signals are the program's.
    code = int(c_pop_signal_handler())
  end subroutine start_petsc

  !> End, and MPI with it where it began with PETSc.
  subroutine stop_petsc()
    integer :: code
    call PetscFinalize(code)
  end subroutine stop_petsc

  !> End all ranks at the first error inside PETSc: calls after it would have undefined handles, and the other ranks are
  !> in the midst of PETSc. So no call needs to look at its code for them; `has_failed` sees codes that come without.
  integer(c_int) function end_at_error(communicator, line, procedure, file, code, kind, message, context) bind(c)
    type(c_ptr), value :: communicator  !! MPI's communicator, an address or a number.
    integer(c_int), value :: line  !! Place in PETSc: line.
    type(c_ptr), value :: procedure  !! Place in PETSc: name of the procedure.
    type(c_ptr), value :: file  !! Place in PETSc: file.
    integer(c_int), value :: code  !! Error code.
    integer(c_int), value :: kind  !! Whether it comes for the first time.
    type(c_ptr), value :: message  !! What is wrong; may be null.
    type(c_ptr), value :: context  !! None.
    associate (not_needed => [line, kind], nor_these => [communicator, file, context])
    end associate
    call print_error('PETSc: '//text_of(procedure)//': '//text_of(message)//' (error code '//to_text(int(code))//')')
    call abort_ranks(exit_machine)
    end_at_error = code
  end function end_at_error

  !> A text of C.
  function text_of(pointer) result(text)
    type(c_ptr), intent(in) :: pointer  !! Its address, or null.
    character(:), allocatable :: text
    character(kind=c_char), pointer :: letters(:)
    integer :: i
    text = ''
    if (.not. c_associated(pointer)) return
    call c_f_pointer(pointer, letters, [c_strlen(pointer)])
    do i = 1, size(letters)
      text = text//letters(i)
    end do
  end function text_of

  !> Whether a call failed. Several ranks end at once: the others are in the midst of PETSc.
  logical function has_failed(code, what, error) result(failed)
    integer, intent(in) :: code  !! What PETSc has returned.
    character(*), intent(in) :: what  !! What was to be done, for the message.
    type(error_t), allocatable, intent(inout) :: error  !! Allocated where it failed; unchanged otherwise.
    failed = code /= 0
    if (.not. failed) return
    call set_error(error, 'PETSc: '//what//': error code '//to_text(code), exit_machine)
    if (n_ranks() == 1) return
    call print_error(error%message)
    call abort_ranks(exit_machine)
  end function has_failed

  !> Set an option, unless the user has: PETSC_OPTIONS and the file .petscrc come first.
  subroutine petsc_option(name, value)
    character(*), intent(in) :: name  !! Its name, with the hyphen.
    character(*), intent(in) :: value  !! Its value.
    integer :: code
    logical :: is_set
    external :: PetscOptionsHasName
    call PetscOptionsHasName(PETSC_NULL_OPTIONS, '', name, is_set, code)
    if (.not. is_set) call PetscOptionsSetValue(PETSC_NULL_OPTIONS, name, value, code)
  end subroutine petsc_option

  !> Sum of arrays of real numbers.
  subroutine sum_of_reals(x)
    real(dp), intent(inout), contiguous :: x(:)  !! The part of this rank, then the sum (any number) [any].
    integer :: code
    if (size(x) > 0) call mpi_allreduce(mpi_in_place, x, size(x), mpi_double_precision, mpi_sum, mpi_comm_world, code)
  end subroutine sum_of_reals

  !> Sum of arrays of integers.
  subroutine sum_of_integers(x)
    integer, intent(inout), contiguous :: x(:)  !! The part of this rank, then the sum (any number).
    integer :: code
    if (size(x) > 0) call mpi_allreduce(mpi_in_place, x, size(x), mpi_integer, mpi_sum, mpi_comm_world, code)
  end subroutine sum_of_integers

  !> Largest numbers of all ranks.
  subroutine largest_of_ranks(x)
    real(dp), intent(inout), contiguous :: x(:)  !! Those of this rank, then of all ranks (any number) [any].
    integer :: code
    call mpi_allreduce(mpi_in_place, x, size(x), mpi_double_precision, mpi_max, mpi_comm_world, code)
  end subroutine largest_of_ranks

  !> How many things lower ranks have.
  integer function first_of_rank(n) result(first)
    integer, intent(in) :: n  !! How many this rank has.
    integer :: code
    first = 0
    call mpi_exscan(n, first, 1, mpi_integer, mpi_sum, mpi_comm_world, code)
    if (this_rank() == 0) first = 0
  end function first_of_rank
end module dotyk_distributed_petsc
