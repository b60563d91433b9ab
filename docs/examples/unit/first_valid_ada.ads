--  The unit of first_valid.c in Ada: votes the first channel that says it is valid and is in range, else holds the last vote.
with Interfaces.C; use Interfaces.C;
with Rig_Unit;     use Rig_Unit;

package First_Valid_Ada is
   function Open (Wanted : access constant Rig_Config) return int
     with Export, Convention => C, External_Name => "rig_unit_open";
   function Step (Input : access constant Rig_Input; Output : access Rig_Output) return int
     with Export, Convention => C, External_Name => "rig_unit_step";
   procedure Close
     with Export, Convention => C, External_Name => "rig_unit_close";
end First_Valid_Ada;
