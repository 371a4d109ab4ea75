!> Estimates of recovered strains held against the residuals of the elements.
!>
!> Recovered strains (`dotyk_elasticity_discretization_error`) are asymptotically exact where the displacement is
!> smooth. They miss up to half of the error at singular edges and the part that no fit sees, such as parabolic shear
!> over one layer of elements; and they are too large where the stiffness jumps and in thin bodies, where polynomials
!> around a vertex are poor. Residuals (`dotyk_elasticity_element_residual`) need no neighbours to be smooth: with a
!> constant for the kind of the elements their energy is 0.8 to 1.5 times the error in both. So they bound the recovered
!> ones from both sides. The constants are measured: docs/errors.md, `studies/error_estimates.py`.
module dotyk_elasticity_residual_check
  use dotyk_base_memory, only: allowance_t
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_bubble_table, only: bubble_table_t
  use dotyk_elasticity_cluster_residual, only: cluster_energy, flat_clusters_t, simplex_bubbles_t
  use dotyk_elasticity_element_residual, only: bubble_factor_t, residual_data_t, residual_energy
  use dotyk_elasticity_face_tractions, only: face_tractions_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_point_stress, only: point_material_t
  use dotyk_elasticity_projected_dilatation, only: unprojected_bulk_ratio
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: n_element_kinds
  implicit none
  private

  !> Error over the root of the energy of the residual of each element kind; none of lines (n_element_kinds) [].
  real(dp), parameter :: constant(n_element_kinds) = [0.0_dp, 0.0_dp, 1.1_dp, 1.4_dp, 1.1_dp, 1.4_dp, 1.5_dp, 0.4_dp, &
                                                      1.0_dp, 0.8_dp, 1.2_dp, 1.2_dp, 0.7_dp, 1.25_dp, 1.25_dp, &
                                                      0.45_dp, 1.1_dp, 1.2_dp]
  !> Recovered strains count where they say at least this fraction of what the residual says [].
  real(dp), parameter :: least_fraction = 0.6_dp
  real(dp), parameter :: most_multiple = 1.6_dp  !! They count up to this multiple of it [].

  public :: check_by_residuals

contains

  !> Hold the squared errors of elements against their residuals. Bodies with a projected dilatation keep theirs.
  subroutine check_by_residuals(mesh, analysis, material, data, u, least, factor, room, face_room, &
                                square, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(residual_data_t), intent(in) :: data  !! Loads and held directions of the bodies.
    real(dp), intent(in), contiguous :: u(:, :, :)  !! In the axes of the mesh (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in) :: least(:)  !! Elements with smaller squared errors are left alone (n_bodies) [energy].
    !> Factors of elements: those that were kept are used, and others are kept where there is room (n_elements).
    type(bubble_factor_t), intent(inout) :: factor(:)
    type(allowance_t), intent(inout) :: room  !! Memory for factors.
    type(allowance_t), intent(inout) :: face_room  !! Memory for the tractions of faces, while this runs.
    real(dp), intent(inout) :: square(:, :)  !! Squared errors, by elements (n_bodies, n_elements) [energy].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the modulus field has no value.
    type(point_material_t) :: point_material(size(material))
    type(bubble_table_t), allocatable :: table(:)
    type(simplex_bubbles_t), allocatable :: bubbles(:)
    type(flat_clusters_t) :: clusters
    type(face_tractions_t) :: tractions
    type(error_t), allocatable :: failure
    real(dp), allocatable :: energy(:, :)
    logical, allocatable :: is_needed(:)
    real(dp) :: matrix(6, 6), lambda, bulk
    integer :: b, c, e, k, m
    allocate (table(size(mesh%block)), bubbles(size(mesh%block)))
    do b = 1, size(mesh%block)
      associate (own => material(mesh%block(b)%material))
        call own%split(analysis, unprojected_bulk_ratio(mesh%block(b)%kind, own%incompressibility), matrix, lambda, &
                       bulk)
      end associate
      if (bulk > 0) return
      call table(b)%init(mesh%block(b)%kind)
      call bubbles(b)%init(table(b), error)
      if (allocated(error)) return
    end do
    do m = 1, size(material)
      call point_material(m)%init(analysis, material(m)%plane_matrix(analysis))
      if (allocated(data%thermal)) then
        point_material(m)%thermal = data%thermal(:, :, :, m)
        point_material(m)%initial = data%initial
        if (material(m)%formulas%vary()) point_material(m)%temperature = data%temperature
      end if
      call point_material(m)%field%init(material(m), error)
      if (allocated(error)) exit
    end do
    if (allocated(error)) then
      call forget()
      return
    end if
    call clusters%init(mesh, data%faces)
    allocate (is_needed(size(square, 2)), source=.false.)
    do b = 1, size(square, 1)
      is_needed = is_needed .or. square(b, :) > least(b)
    end do
    call tractions%find(mesh, data%faces, point_material, table, u, is_needed, face_room)
    ! A formula serves one thread.
    !$omp parallel do default(none) schedule(dynamic, 16) if (all(point_material%field%constant)) &
    !$omp& private(failure, energy, b, e, k) &
    !$omp& shared(mesh, data, point_material, table, bubbles, tractions, clusters, u, is_needed, least, factor, room, &
    !$omp& square, error)
    do c = 1, clusters%n
      associate (own => clusters%element(clusters%first(c):clusters%first(c + 1) - 1))
        if (.not. any(is_needed(own))) cycle
        if (allocated(energy)) deallocate (energy)
        allocate (energy(size(square, 1), size(own)))
        if (size(own) > 1) then
          call cluster_energy(mesh, data, point_material, table, bubbles, tractions, u, own, energy, failure)
        else
          call residual_energy(mesh, data, point_material, table, tractions, u, own(1), factor(own(1)), room, &
                               energy(:, 1), failure)
        end if
        if (allocated(failure)) then
          !$omp critical
          if (.not. allocated(error)) call move_alloc(failure, error)
          !$omp end critical
          cycle
        end if
        do k = 1, size(own)
          e = own(k)
          energy(:, k) = constant(mesh%block(data%faces%block(e))%kind)**2*energy(:, k)
          do b = 1, size(energy, 1)
            ! Whatever the other bodies are.
            if (square(b, e) > least(b)) call hold(energy(b, k), square(b, e))
          end do
        end do
      end associate
    end do
    !$omp end parallel do
    call forget()

  contains

    !> Free the formulas.
    subroutine forget()
      integer :: m
      do m = 1, size(point_material)
        call point_material(m)%field%destroy()
      end do
    end subroutine forget
  end subroutine check_by_residuals

  !> Hold one number against the other.
  pure subroutine hold(residual, recovered)
    real(dp), intent(in) :: residual  !! Squared error by the residual; none where it is 0 [energy].
    real(dp), intent(inout) :: recovered  !! Squared error by recovered strains [energy].
    if (.not. residual > 0) return
    if (recovered < least_fraction**2*residual) recovered = residual
    recovered = min(recovered, most_multiple**2*residual)
  end subroutine hold
end module dotyk_elasticity_residual_check
