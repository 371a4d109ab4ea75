!> Resultant of the contact pressure of a pair on body a: force, moment about the origin, and centre of pressure.
!>
!> The forces of the rows are distributed to their integration points, along the normals there. On body b they act at
!> the projections x' of these points. As x' - x is parallel to the normal (`dotyk_contact_projection`), force and
!> moment on body b are the opposite ones.
module dotyk_contact_pair_resultant
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_kinds, only: dp
  use dotyk_contact_pair, only: contact_pair_t, pair_force
  use dotyk_mesh_facet, only: cross
  implicit none
  private

  type, public :: pair_resultant_t  !! Resultant on body a.
    real(dp) :: force(3) = 0  !! Force; along the axis in axisymmetric analyses (3) [force].
    real(dp) :: moment(3) = 0  !! Moment about the origin; 0 in axisymmetric analyses (3) [force length].
    !> Radial components in axisymmetric analyses, summed around the circumference: no resultant; 0 in others [force].
    real(dp) :: radial = 0
    !> Where the resultant acts: the point of its line of action that is nearest to the mean of the positions, weighted
    !> with the pressure; NaN where the pressures have no resultant force (3) [length].
    real(dp) :: centre(3) = 0
  end type pair_resultant_t

  public :: pair_resultant

  !> Resultants below this fraction of the sum of the forces are what rounding and the tolerance of the solution leave.
  real(dp), parameter :: no_force = 1.0e-6_dp

contains

  !> Resultant of pressures.
  pure type(pair_resultant_t) function pair_resultant(pair, axisymmetric, pressure) result(resultant)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    logical, intent(in) :: axisymmetric  !! Whether forces are those on the full circumference.
    real(dp), intent(in) :: pressure(:)  !! Row pressures (n_rows) [pressure].
    real(dp), allocatable :: at_points(:)
    real(dp) :: x(3), f(3), mean(3), total
    integer :: q
    allocate (at_points(pair%n_points))
    call pair%average%multiply_transposed(pair%row_weight*pressure, at_points)
    mean = 0
    total = sum(abs(at_points))
    x = 0
    f = 0
    resultant%force = pair_force(pair, pressure)
    do q = 1, pair%n_points
      x(:pair%dimension) = pair%position(:, q)
      f(:pair%dimension) = -pair%normal(:, q)*at_points(q)
      mean = mean + at_points(q)*x
      resultant%moment = resultant%moment + cross(x, f)
    end do
    if (axisymmetric) then
      resultant%radial = resultant%force(1)
      resultant%force(1) = 0
      resultant%moment = 0
      mean(1) = 0
    end if
    associate (force => resultant%force)
      if (norm2(force) > no_force*total .and. total > 0) then
        resultant%centre = mean/sum(at_points)
        if (.not. axisymmetric) &
          resultant%centre = resultant%centre + cross(force/norm2(force), &
                                                      (resultant%moment - cross(resultant%centre, force))/norm2(force))
      else
        resultant%centre = ieee_value(total, ieee_quiet_nan)
      end if
    end associate
  end function pair_resultant
end module dotyk_contact_pair_resultant
