"""A person of given height and weight who walks under joint torques, stumbles, and falls when balance is lost."""
