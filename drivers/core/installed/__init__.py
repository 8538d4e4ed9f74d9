"""What is installed in addition to the program: packages of extras, and plug-ins."""
