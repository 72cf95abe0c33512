import sys

from dropanchor_tag_client.cli import main

sys.exit(main())
