"""A small plan with a branch, for the small world of the rover's tests."""

from __future__ import annotations

import json
from pathlib import Path

from tests.rover_iface.worlds import small_problem

CRL = """
(plan :id small
  :resources ((energy :consumable :key :battery-energy))
  :overrun-penalty 4
  :budgets ((time 2300) (energy 300000))
  :node
  (block :id root
    :maintain-conditions ((database (:time <= 2600)))
    :node-list
    ((task :id track-T1 :continue-on-failure t :action trackstart :parameters (target = T1))
     (task :id track-T2 :continue-on-failure t :action trackstart :parameters (target = T2))
     (task :id drive-T1 :continue-on-failure t :action navigate :parameters (target = T1))
     (task :id look-T1 :continue-on-failure t :reward 5 :metadata (observation = T1-img)
       :action image :parameters (target = T1 instrument = scicam))
     (branch :id choice
       :options
       ((option :id stay :utility 5 :probability 0.5
          :eligible-conditions ((database (:time < 800)))
          :node
          (block :id at-T1
            :start-conditions ((database (:trackerstate T1 = tracked)))
            :continue-on-failure t
            :node-list
            ((task :id touch-T1 :continue-on-failure t :reward 5 :metadata (observation = T1-mi)
               :action ipplaceinstrument :parameters (target = T1 instrument = mi)))))
        (option :id go :utility 1
          :node
          (block :id go-on
            :node-list
            ((task :id drive-T2 :action navigate :parameters (target = T2))
             (task :id touch-T2 :continue-on-failure t :reward 5 :metadata (observation = T2-mi)
               :action ipplaceinstrument :parameters (target = T2 instrument = mi))))))))))
"""


def write_small(folder: Path) -> tuple[Path, Path]:
    """Return the files of plan and world, written into a folder."""
    plan, world = folder / "plan.crl", folder / "world.json"
    plan.write_text(CRL)
    world.write_text(json.dumps({"format": "world/1", "name": "small", "problem": small_problem()}))
    return plan, world
