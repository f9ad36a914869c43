#!/usr/bin/env python3
"""Converts the official files (network weights, body model, priors) to the plain safetensors files that the toolkit
reads. It executes nothing that an official file contains (restricted_pickle.py). docs/assets.md says where to get the
files.
"""

from __future__ import annotations

import argparse
import json
import sys

FAILURE, USAGE, INTERRUPTED = 1, 2, 130


def main(arguments=None) -> int:
    options = _parser().parse_args(arguments)
    try:
        return options.run(options) or 0
    except KeyboardInterrupt:
        print("import_assets: interrupted; no incomplete file is left", file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        print(f"import_assets: {where}{error.strerror or error}", file=sys.stderr)
        return FAILURE
    except MemoryError:
        print("import_assets: out of memory", file=sys.stderr)
        return FAILURE
    except ValueError as error:  # BrokenPickle, RefusedPickle, TensorFileError, ImportFault
        print(f"import_assets: {error}", file=sys.stderr)
        return FAILURE


def _say(line: str) -> None:
    print(line, flush=True)


def _checkpoint(options) -> None:
    import prima_import

    settings = dict(options.set)
    if options.config:
        with open(options.config, encoding="utf-8") as file:
            try:
                settings = json.load(file) | settings
            except (ValueError, TypeError, RecursionError) as error:
                raise prima_import.ImportFault(f"{options.config}: not a JSON object: {error}") from None
    prima_import.import_checkpoint(
        options.input,
        options.output,
        _say,
        settings=settings,
        open_clip_config=options.open_clip_config,
        keep_text=options.keep_text,
        drop=options.drop,
        check_sums=not options.skip_crc,
    )


def _backbone(options) -> None:
    import prima_import

    prima_import.import_backbone(options.input, options.into, options.output, _say, not options.skip_crc)


def _bioclip(options) -> None:
    import prima_import

    prima_import.import_bioclip(
        options.input, options.open_clip_config, options.into, options.output, _say, not options.skip_crc
    )


def _smal(options) -> None:
    import smal_import

    smal_import.import_body(options.input, options.output, _say)


def _priors(options) -> None:
    import smal_import

    smal_import.import_priors(options.families, options.pose, options.output, _say)


def _fetch(options) -> int:
    import asset_terms
    import fetch_assets

    try:
        return fetch_assets.run(
            options.folder, options.stage, options.training, options.offline, options.accept_licences, _say
        )
    except asset_terms.ConsentMissing as error:
        print(f"import_assets: {error}", file=sys.stderr)
        return USAGE


def _setting(text: str) -> tuple[str, object]:
    key, equals, value = text.partition("=")
    try:
        return key, json.loads(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not KEY=VALUE, as in heads=16 or clip_quick_gelu=true") from None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="import_assets.py",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="""One command fetches the missing files and imports them:
  make assets

By hand:
  import_assets.py checkpoint s1ckpt_inference.ckpt assets/prima.safetensors
  import_assets.py smal my_smpl_00781_4_all.pkl assets/smal.safetensors
  import_assets.py priors my_smpl_data_00781_4_all.pkl walking_toy_symmetric_pose_prior_with_cov_35parts.pkl \\
      assets/priors.safetensors
`import_assets.py COMMAND --help` explains a command by example.
Exit codes: 0 done, 1 a file cannot be used (the message says why), 2 wrong usage or no consent, 130 stopped.""",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_checkpoint(commands)
    _add_smal(commands)
    _add_priors(commands)
    _add_parts(commands)
    _add_fetch(commands)
    return parser


def _command(commands, name: str, run, summary: str, example: str) -> argparse.ArgumentParser:
    added = commands.add_parser(
        name,
        help=summary,
        description=summary[0].upper() + summary[1:] + ".",
        epilog="Example:\n" + example,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    added.set_defaults(run=run)
    return added


def _add_weight_files(added: argparse.ArgumentParser, what: str) -> None:
    added.add_argument("input", metavar="IN", help=what)
    added.add_argument("output", metavar="OUT", help="safetensors file to write")
    added.add_argument(
        "--skip-crc", action="store_true", help="do not compare the zip's check sums (for files that have none)"
    )


def _add_checkpoint(commands) -> None:
    added = _command(
        commands,
        "checkpoint",
        _checkpoint,
        "import the network from a Lightning checkpoint",
        """  import_assets.py checkpoint s1ckpt_inference.ckpt assets/prima.safetensors

Either all 955 tensors of the official state dict fit, or the command names every tensor that is missing, extra or of a
wrong shape, and writes nothing. The network's sizes come from the shapes of the weights. The shapes do not determine
the attention heads, IEF iterations, focal length and quick GELU. These come from --set, --config, the file's
hyperparameters, or the official values, in this order; the output says which:
  import_assets.py checkpoint mine.ckpt mine.safetensors --set heads=4 --set dec_heads=4 --set clip_heads=4""",
    )
    _add_weight_files(added, "Lightning checkpoint (*.ckpt)")
    added.add_argument("--open-clip-config", metavar="JSON", help="BioCLIP's config, for quick GELU and heads")
    added.add_argument("--config", metavar="JSON", help="file with config values, for example {\"ief_iterations\": 3}")
    added.add_argument("--set", type=_setting, action="append", default=[], metavar="KEY=VALUE", help="a config value")
    added.add_argument("--keep-text", action="store_true", help="keep CLIP's unused text tower (254 MB)")
    added.add_argument("--drop", action="append", default=[], metavar="PREFIX", help="leave out these unknown tensors")


def _add_smal(commands) -> None:
    added = _command(
        commands,
        "smal",
        _smal,
        "import the SMAL body model",
        """  import_assets.py smal my_smpl_00781_4_all.pkl assets/smal.safetensors

Reads the released Python 2 pickle (chumpy, scipy) and adds the vertex groups of the 26 keypoints.""",
    )
    added.add_argument("input", metavar="IN", help="my_smpl_00781_4_all.pkl")
    added.add_argument("output", metavar="OUT", help="safetensors file to write")


def _add_priors(commands) -> None:
    added = _command(
        commands,
        "priors",
        _priors,
        "import the shape families and the pose prior",
        """  import_assets.py priors my_smpl_data_00781_4_all.pkl \\
      walking_toy_symmetric_pose_prior_with_cov_35parts.pkl assets/priors.safetensors""",
    )
    added.add_argument("families", metavar="FAMILIES", help="my_smpl_data_00781_4_all.pkl")
    added.add_argument("pose", metavar="POSE", help="walking_toy_symmetric_pose_prior_with_cov_35parts.pkl")
    added.add_argument("output", metavar="OUT", help="safetensors file to write")


def _add_parts(commands) -> None:
    added = _command(
        commands,
        "bioclip",
        _bioclip,
        "put an OpenCLIP image tower into a checkpoint",
        """  quadruped3d init --size vith --out assets/fresh.safetensors
  import_assets.py bioclip open_clip_pytorch_model.bin --open-clip-config open_clip_config.json \\
      --into assets/fresh.safetensors assets/start.safetensors

This is for training from scratch; the official checkpoint already holds BioCLIP. The open_clip_config.json says whether
the tower uses quick GELU, and how many heads it has.""",
    )
    _add_weight_files(added, "open_clip_pytorch_model.bin or open_clip_model.safetensors")
    added.add_argument("--open-clip-config", required=True, metavar="JSON", help="open_clip_config.json beside it")
    added.add_argument("--into", required=True, metavar="CHECKPOINT", help="safetensors file with the other tensors")

    added = _command(
        commands,
        "backbone",
        _backbone,
        "put AniMer's ViT into a checkpoint",
        """  import_assets.py backbone amr_vitbb.pth --into assets/fresh.safetensors assets/start.safetensors

This is for training from scratch, as in the paper. The command uses only the tensors backbone.*.""",
    )
    _add_weight_files(added, "AniMer checkpoint (amr_vitbb.pth)")
    added.add_argument("--into", required=True, metavar="CHECKPOINT", help="safetensors file with the other tensors")


def _add_fetch(commands) -> None:
    added = _command(
        commands,
        "fetch",
        _fetch,
        "download the missing files, verify and import them (make assets)",
        """  import_assets.py fetch                 the Stage 1 network, the body, the priors, into assets/
  import_assets.py fetch --stage 3       the Stage 3 network instead
  import_assets.py fetch --offline       only verify and import the files in assets/official

It shows the terms of the files and asks whether you accept them; --accept-licences accepts them without asking, and
without a terminal that is the only way (exit code 2 otherwise). Without a network it says which files to put where.""",
    )
    added.add_argument("--folder", default="assets", help="where the results go (default: assets)")
    added.add_argument("--stage", choices=("1", "3"), default="1", help="which network (default: 1, the dataset's)")
    added.add_argument("--training", action="store_true", help="also fetch AniMer's ViT and BioCLIP's weights")
    added.add_argument("--offline", action="store_true", help="download nothing")
    added.add_argument(
        "--accept-licences", "--accept-licenses", action="store_true", help="accept the terms of the files unasked"
    )


if __name__ == "__main__":
    sys.exit(main())
