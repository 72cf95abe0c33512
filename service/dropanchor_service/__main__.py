"""`python -m dropanchor_service`"""

import sys

from dropanchor_service.cli import main

if __name__ == "__main__":
    sys.exit(main())
