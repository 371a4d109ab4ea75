!> What is on one rank of each node: matrices of the size of the contact surfaces and their factors, which all ranks of
!> a node would else hold and read at the same time. The other ranks get the results.
!>
!> Every node computes the same, so that results are the same to the bit on all ranks.
module dotyk_distributed_node_keeper
  use mpi_f08, only: mpi_bcast, mpi_comm, mpi_comm_free, mpi_comm_rank, mpi_comm_split_type, mpi_comm_type_shared, &
    mpi_comm_world, mpi_double_precision, mpi_info_null
  use dotyk_base_kinds, only: dp
  implicit none
  private

  type, public :: node_keeper_t  !! The ranks of a node. All ranks call its procedures together.
    logical :: keeps = .true.  !! Whether this rank is the one that keeps.
    type(mpi_comm), private :: ranks  !! The ranks of the node.
    logical, private :: is_set = .false.  !! Whether there is such a communicator.
  contains
    procedure :: init => keeper_init
    procedure :: tell => keeper_tell
    procedure :: destroy => keeper_destroy
  end type node_keeper_t

contains

  !> Choose the first rank of each node.
  subroutine keeper_init(self)
    class(node_keeper_t), intent(out) :: self
    integer :: rank
    call mpi_comm_split_type(mpi_comm_world, mpi_comm_type_shared, 0, mpi_info_null, self%ranks)
    call mpi_comm_rank(self%ranks, rank)
    self%keeps = rank == 0
    self%is_set = .true.
  end subroutine keeper_init

  !> Make the numbers of the rank that keeps known to all ranks of its node.
  subroutine keeper_tell(self, x)
    class(node_keeper_t), intent(in) :: self
    !> Those of the rank that keeps in, on all ranks out (any number) [any].
    real(dp), intent(inout), contiguous :: x(:)
    call mpi_bcast(x, size(x), mpi_double_precision, 0, self%ranks)
  end subroutine keeper_tell

  !> Give back the communicator.
  subroutine keeper_destroy(self)
    class(node_keeper_t), intent(inout) :: self
    if (self%is_set) call mpi_comm_free(self%ranks)
    self%is_set = .false.
  end subroutine keeper_destroy
end module dotyk_distributed_node_keeper
