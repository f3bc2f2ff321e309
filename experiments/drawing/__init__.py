"""Pictures of robots in their worlds, without a display: poses, filmstrips of motions, clouds of a marker."""
