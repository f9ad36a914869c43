"""What the end-to-end scripts share.

A script (tests/**/*_end_to_end.py) is a module of `Case` classes. It is run by this package's command line, see
__main__.py, which also tells it where the program is. The parts:

    case       Case: tests that share one expensive folder and write only into a folder of their own
    program    run and start the program; make it stop, hang or fail at an exact point; kill and resume it
    ranks      start the program as ranks that share a build
    scene      Scene: drawn pictures, a tiny network, a config and calibrated thresholds; cases that share one
    pictures   draw pictures and annotations, give bodies to annotations, make networks and the rendered world
    intake     IntakeCase: label files as people have them, over pictures with a dot at each keypoint
    pages      cut the files and commands out of a page of docs
    datasets   read what the program wrote: verdicts, labels, digests, journals; damage files
"""

from . import pages
from .case import Case
from .datasets import (build_digests, copy_folder, digests, file_sha256, flip_bit, journal_lines, kept, latest, read_byte_column,
                       read_csv, read_safetensors, read_samples, seal_json, split_safetensors, stamps,
                       units_in_journals, verdicts, write_safetensors)
from .pictures import (FOCAL, draw_pictures, give_bodies, make_network, prima_dataset, render_world, smooth_picture,
                       world_animal3d, world_body, world_superanimal, write_annotations, write_json)
from .program import (LIMIT_S, Fault, Started, alarm_seconds, command, environment, fault_lines, kill_and_resume, program,
                      run, run_json, started, wait_until)
from .ranks import Rank, launcher_store, own_store, ranks_of
from .scene import PICTURES, UNIT, DrawnCase, Scene, SceneCase, SmallUnitsCase
