"""The live page: a process of its own that shows a session and sends back what is pressed.

Nothing here can delay or stop a recording: the session hands over copies through a bounded queue and never waits.
"""
