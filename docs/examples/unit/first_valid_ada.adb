--  Nothing here needs Ada's run-time system, so a C program can load it without a word of Ada.
pragma Suppress (All_Checks);
with Interfaces; use Interfaces;

package body First_Valid_Ada is
   Config  : Rig_Config;
   Vote    : IEEE_Float_64_16;
   Stepped : Unsigned_64;

   function Open (Wanted : access constant Rig_Config) return int is
   begin
      Config  := Wanted.all;
      Stepped := 0;
      for I in Vote'Range loop
         Vote (I) := 0.0;
      end loop;
      return (if Wanted.Layout = Layout then 0 else 1);
   end Open;

   function Step (Input : access constant Rig_Input; Output : access Rig_Output) return int is
   begin
      for I in Vote'Range loop
         declare
            Fitted    : constant Integer := Integer (Config.Signal (I).Fitted);
            Low, High : IEEE_Float_64;
            X         : IEEE_Float_64;
         begin
            Low  := Config.Signal (I).Low;
            High := Config.Signal (I).High;
            for C in reverse 0 .. Fitted - 1 loop --  backwards: the first channel has the last word
               X := Input.Channels (I, C);
               if Input.Valid (I, C) /= 0 and then Low <= X and then X <= High then --  false for NaN
                  Vote (I) := X;
               end if;
            end loop;
            for C in Fitted .. 3 loop
               Output.State (I, C) := State_Absent;
            end loop;
            Output.Level (I) := Unsigned_8 (Fitted);
         end;
      end loop;
      Stepped        := Stepped + 1;
      Output.Voted   := Vote;
      Output.Stepped := Stepped;
      Output.Said    := Said_Voted or Said_State;
      return 0;
   end Step;

   procedure Close is null;
end First_Valid_Ada;
