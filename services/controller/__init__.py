"""The MoBeE controller: forces and goals in, motor commands out, once a tick."""
