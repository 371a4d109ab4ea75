#!/usr/bin/python3
"""Balance, signs and complementarity in free_stack.vtkhdf: check.py [results file]. Needs h5py and numpy. Exit code 1: wrong."""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

LOAD = 50e6*0.6**2       # pressure times patch, as in free_stack.nml and free_stack.geo
EDGE, PLATES = 1.0, 8

# Forces balance to the round-off of the solver, whatever the mesh; so do areas, as the patch and the faces are flat.
BALANCE = 1e-9
# Without penalty the last step solves the equations of the active set to round-off, and checks that set to the tolerance of 1e-8.
COMPLEMENTARITY = 1e-8


def errors(path):
    """What is out of balance relative to the load, what is wrong at single points, and the part of each joint that is open."""
    e = {'force': 0.0, 'force along the joints': 0.0, 'area': 0.0, 'tension': 0.0, 'pressure where open': 0.0,
         'penetration': 0.0}
    figures = {'open': [], 'peak': []}
    results = dotyk.Results(path)
    e['not converged'] = 1 - results.summary['converged']
    movement = max(np.linalg.norm(results['displacement'], axis=1))
    for k in range(1, PLATES):
        joint = results.pairs['joint %d' % k]
        w, p, gap, force = joint.weight, joint.pressure, joint.gap, joint.force
        e['force'] = max(e['force'], abs(abs(force[2])/LOAD - 1), abs(np.sum(w*p)/LOAD - 1))
        e['force along the joints'] = max(e['force along the joints'], np.abs(force[:2]).max()/LOAD)
        e['area'] = max(e['area'], abs(np.sum(w)/EDGE**2 - 1))
        e['tension'] = max(e['tension'], -p.min()/p.max())
        e['pressure where open'] = max(e['pressure where open'], np.max(p*np.maximum(0, gap))/(p.max()*movement))
        e['penetration'] = max(e['penetration'], -gap.min()/movement)
        figures['open'].append(np.sum(w[p == 0])/EDGE**2)
        figures['peak'].append(p.max())
    # Without initial gaps the energy is minus half the work of the load, at any theta.
    figures['compliance'] = -2*results.summary['energy']/LOAD**2
    e['closed everywhere'] = float(max(figures['open']) < 0.01)
    return e, figures


LIMITS = {'force': BALANCE, 'force along the joints': BALANCE, 'area': BALANCE, 'tension': 0, 'not converged': 0,
          'closed everywhere': 0, 'pressure where open': COMPLEMENTARITY, 'penetration': COMPLEMENTARITY}

if __name__ == '__main__':
    default = os.path.join(FOLDER, 'free_stack.vtkhdf')
    e, figures = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    print('load %.6g N, compliance (work of the load/load^2) %.4e m/N' % (LOAD, figures['compliance']))
    for k in range(1, PLATES):
        print('joint %d: %2.0f %% open, peak pressure %.4g Pa' % (k, 100*figures['open'][k - 1], figures['peak'][k - 1]))
    for name, error in e.items():
        print('%-24s %.1e%s' % (name, error, '' if error <= LIMITS[name] else '   WRONG'))
    sys.exit(any(error > LIMITS[name] for name, error in e.items()))
