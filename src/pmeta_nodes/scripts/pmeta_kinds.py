"""The kinds of figures that run folders give, and the one call that draws them."""

import pmeta_action_values as pa
import pmeta_convergence as pc
import pmeta_drawing as pd
import pmeta_figures as pf
import pmeta_method_curves as pm
import pmeta_trajectories as pt
import pmeta_unseen as pu
import pmeta_value_maps as pv

KINDS = ("curves", "comparison", "sweep", "tasks", "unseen", "trajectories", "values", "convergence")


def draw(experiments, convergence, kinds, figures):
    """Draws what the data allow; `figures` holds a pd.Figures for each kind."""
    with pd.style():
        pf.draw_runs(experiments, kinds, figures)
        if "comparison" in kinds:
            pm.draw_comparison(experiments, figures["comparison"])
        if "unseen" in kinds:
            pu.draw_unseen(experiments, figures["unseen"])
            pm.draw_unseen_methods(experiments, figures["unseen"])
        if "trajectories" in kinds:
            pt.draw_trajectories(experiments, figures["trajectories"])
        if "values" in kinds:
            pv.draw_value_maps(experiments, figures["values"])
            pa.draw_action_values(experiments, figures["values"])
        if "convergence" in kinds:
            pc.draw_convergence(convergence, figures["convergence"])
