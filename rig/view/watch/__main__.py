"""The process that draws: see draw.InProcess."""

from rig.view.watch.draw import main

if __name__ == "__main__":
    main()
