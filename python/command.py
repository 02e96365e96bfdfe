#!python
# SPDX-License-Identifier: Apache-2.0
"""The command `tangere` of an installed wheel: becomes the program inside the package.

The package itself is not imported, which would take longer than most commands.
"""

import os
import sys

for folder in sys.path:
    program = os.path.join(folder, "tangere", "bin", "tangere")
    if os.access(program, os.X_OK):
        os.environ.setdefault("TANGERE_PYTHON", sys.executable)  # for `export --to`
        os.execv(program, sys.argv)
sys.exit("tangere: no tangere/bin/tangere on Python's path; expected it beside the package")
